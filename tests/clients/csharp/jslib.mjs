// Runs ManipNet.jslib as Emscripten does, with a live web socket: `jslib.mjs SCRIPT ADDRESS`.
import { readFileSync } from "node:fs";
import vm from "node:vm";

const [script, address] = process.argv.slice(2);
const memory = new Uint8Array(1 << 18);
const library = {};
const scope = { LibraryManager: { library }, mergeInto: Object.assign, HEAPU8: memory, WebSocket, Uint8Array };
scope.UTF8ToString = (text) => text;
vm.createContext(scope);
vm.runInContext(readFileSync(script, "utf8"), scope);
scope.manipnet = library.$manipnet; // Emscripten makes a name with $ a global of the module

const socket = library.ManipNetOpen(address);
for (let i = 0; i < 500 && library.ManipNetNextLength(socket) === 0; i++) await new Promise((done) => setTimeout(done, 10));
const length = library.ManipNetNextLength(socket);
library.ManipNetTake(socket, 64, memory.length - 64);
const magic = String.fromCharCode(...memory.subarray(64, 68));
library.ManipNetClose(socket);
const closed = library.ManipNetState(socket);
const refused = library.ManipNetState(library.ManipNetOpen("nonsense://"));
console.log(JSON.stringify({ functions: Object.keys(library), length, magic, closed, refused }));
process.exit(0);
