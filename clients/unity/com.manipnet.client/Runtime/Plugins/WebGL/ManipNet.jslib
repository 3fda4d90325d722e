// The browser's web socket for WebGL builds. Sockets have numbers from 1; messages wait until C# takes them, the newest 32.
mergeInto(LibraryManager.library, {
  $manipnet: { sockets: [null] },

  ManipNetOpen: function (address) {
    var entry = { socket: null, messages: [], state: 0 };
    manipnet.sockets.push(entry);
    try {
      entry.socket = new WebSocket(UTF8ToString(address));
    } catch (error) {
      entry.state = 2; // the browser allows no such address
      return manipnet.sockets.length - 1;
    }
    entry.socket.binaryType = "arraybuffer";
    entry.socket.onopen = function () {
      entry.state = 1;
    };
    entry.socket.onmessage = function (event) {
      entry.messages.push(new Uint8Array(event.data));
      if (entry.messages.length > 32) entry.messages.shift();
    };
    entry.socket.onclose = entry.socket.onerror = function () {
      entry.state = 2;
    };
    return manipnet.sockets.length - 1;
  },
  ManipNetOpen__deps: ["$manipnet"],

  ManipNetState: function (socket) {
    var entry = manipnet.sockets[socket];
    return entry ? entry.state : 2;
  },
  ManipNetState__deps: ["$manipnet"],

  ManipNetNextLength: function (socket) {
    var entry = manipnet.sockets[socket];
    return entry && entry.messages.length > 0 ? entry.messages[0].length : 0;
  },
  ManipNetNextLength__deps: ["$manipnet"],

  ManipNetTake: function (socket, into, capacity) {
    var message = manipnet.sockets[socket].messages.shift();
    if (message.length <= capacity) HEAPU8.set(message, into);
  },
  ManipNetTake__deps: ["$manipnet"],

  ManipNetClose: function (socket) {
    var entry = manipnet.sockets[socket];
    if (!entry) return;
    manipnet.sockets[socket] = null;
    if (entry.socket) entry.socket.close();
  },
  ManipNetClose__deps: ["$manipnet"],
});
