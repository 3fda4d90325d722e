// What the page adds to viser's client: its title, the import of files that are dropped on it, the place of the stage
// for the style sheet, and keys that mean one thing only.
document.title = "ManipNet Live";

const veil = document.createElement("div");
veil.className = "mn-veil";
veil.textContent = "Drop a mesh (OBJ, PLY, STL, GLB): the chosen body carries it\nor an avatar (VRM, GLB with a skeleton): the actor gets its hands";
document.body.append(veil);

const note = document.createElement("div");
note.id = "drop-note";
note.className = "mn-note";
document.body.append(note);

function notify(text) {
  note.textContent = text;
  note.style.display = "block";
  clearTimeout(notify.timer);
  notify.timer = setTimeout(() => (note.style.display = "none"), 8000);
}

function importFile(file) {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const visitor = document.querySelector(".mn-big")?.dataset.visitor ?? "";
  const about = new URLSearchParams({ name: file.name, visitor });
  const socket = new WebSocket(`${scheme}://${location.host}/drop?${about}`);
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

// The style sheet puts the frame and the card over the stage, which is the largest canvas.
function placeStage() {
  const area = (canvas) => canvas.clientWidth * canvas.clientHeight;
  const canvas = [...document.querySelectorAll("canvas")].sort((a, b) => area(b) - area(a))[0];
  if (!canvas) return;
  const seen = { left: 0, top: 0, right: innerWidth, bottom: innerHeight };
  for (let box = canvas; box; box = box.parentElement) {
    const { left, top, right, bottom } = box.getBoundingClientRect();
    if (box !== canvas && getComputedStyle(box).overflow === "visible") continue;
    seen.left = Math.max(seen.left, left);
    seen.top = Math.max(seen.top, top);
    seen.right = Math.min(seen.right, right);
    seen.bottom = Math.min(seen.bottom, bottom);
  }
  const place = { left: seen.left, top: seen.top, width: seen.right - seen.left, height: seen.bottom - seen.top };
  for (const [name, pixels] of Object.entries(place))
    document.documentElement.style.setProperty(`--mn-${name}`, `${pixels}px`);
}
setInterval(placeStage, 250);
addEventListener("resize", placeStage);

// While a take is shown, arrows step through it and do not turn the camera, for which viser listens at the document.
document.documentElement.addEventListener("keydown", (event) => {
  if (event.key.startsWith("Arrow") && document.querySelector(".mn-take")) event.stopPropagation();
});

// A button or slider that was clicked does not keep the keys: space would click it again.
addEventListener("pointerup", () =>
  setTimeout(() => {
    const focused = document.activeElement;
    if (focused && focused.matches("button, [role=slider], [role=tab], input[type=checkbox]")) focused.blur();
  }),
);
