// What the page adds to viser's client: its title, and the import of files that are dropped on it.
document.title = "ManipNet Live";

const veil = document.createElement("div");
veil.textContent = "Drop a mesh file here: OBJ, PLY, STL or GLB";
veil.style.cssText =
  "position:fixed;inset:0;z-index:9999;display:none;align-items:center;justify-content:center;pointer-events:none;" +
  "font:600 24px sans-serif;color:#fff;background:rgba(30,60,110,.55);border:4px dashed #58a6ff";
document.body.append(veil);

const note = document.createElement("div");
note.id = "drop-note";
note.style.cssText =
  "position:fixed;left:50%;bottom:28px;transform:translateX(-50%);z-index:9999;display:none;max-width:70%;" +
  "padding:10px 18px;border-radius:8px;font:15px sans-serif;color:#fff;background:#22304a";
document.body.append(note);

function notify(text) {
  note.textContent = text;
  note.style.display = "block";
  clearTimeout(notify.timer);
  notify.timer = setTimeout(() => (note.style.display = "none"), 8000);
}

function importFile(file) {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const socket = new WebSocket(`${scheme}://${location.host}/drop?name=${encodeURIComponent(file.name)}`);
  notify(`importing ${file.name} …`);
  socket.onopen = async () => socket.send(await file.arrayBuffer());
  socket.onmessage = (event) => notify(event.data);
  socket.onclose = (event) => event.reason && notify(event.reason);
}

addEventListener("dragover", (event) => {
  event.preventDefault();
  veil.style.display = "flex";
});
addEventListener("dragleave", (event) => event.relatedTarget || (veil.style.display = "none"));
addEventListener("drop", (event) => {
  event.preventDefault();
  veil.style.display = "none";
  for (const file of event.dataTransfer.files) importFile(file);
});
