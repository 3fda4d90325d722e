// Keeps changes in order that follow each other closely, as they do when a busy browser catches up with what was typed.
// Viser's client sends what the controls of a panel report at most every 50 ms, and of what comes meanwhile only the newest:
// a text is lost if the next field is changed or a button is clicked within that time. So a change in another control
// waits until the change before it has been sent.
const SENT_MS = 60;
const CONTROLS = "button, input, textarea, [role=option], .mantine-Slider-root";
const EDITS = { insertText: "insertText", insertFromPaste: "insertText", deleteContentBackward: "delete" };

let unsent = null; // the control whose change may not have been sent yet
let sending = 0;
let repeating = false;
const waiting = [];

function noteChange(control) {
  unsent = control;
  clearTimeout(sending);
  sending = setTimeout(() => {
    unsent = null;
    repeatWaiting();
  }, SENT_MS);
}

function repeatWaiting() {
  while (waiting.length && (unsent === null || unsent === waiting[0].control)) {
    const { control, repeat } = waiting.shift();
    repeating = true;
    repeat();
    repeating = false;
    noteChange(control); // no event tells of what a script inserts into a field
  }
}

// Notes the change that an event makes, or stops the event and repeats it later.
function inOrder(event, control, repeat) {
  const inTurn = repeating || (!waiting.length && (unsent === null || unsent === control));
  if (inTurn || !repeat || !event.cancelable) return noteChange(control);
  event.preventDefault();
  event.stopImmediatePropagation();
  waiting.push({ control, repeat });
}

function edit(field, command, text) {
  const focused = document.activeElement;
  if (focused !== field) field.focus();
  document.execCommand(command, false, text);
  if (focused !== field && focused) focused.focus();
}

addEventListener(
  "click",
  (event) => {
    const control = event.target.closest(CONTROLS);
    const clicked = control && (control.matches("input:not([type=checkbox]), textarea, .mantine-Slider-root") ? null : control);
    if (clicked) inOrder(event, clicked, () => clicked.click());
  },
  true,
);
addEventListener(
  "beforeinput",
  (event) => {
    const command = EDITS[event.inputType];
    inOrder(event, event.target, command && (() => edit(event.target, command, event.data)));
  },
  true,
);
addEventListener("submit", (event) => inOrder(event, event.target, () => event.target.requestSubmit()), true);
addEventListener(
  "pointermove",
  (event) => {
    const slider = event.buttons && event.target.closest(".mantine-Slider-root");
    if (slider) noteChange(slider);
  },
  true,
);
