"""The tab that calibrates hands: the instructions, the position of the sheet, and the quality of the result."""

import time
from pathlib import Path
from typing import Any, Final

import viser

from manipnet.page.controls import Ask, Perform

COUNTDOWN_S: Final = 3
"""From the click to the request. It uses the last 2 s, in which the hand that clicked must already lie still."""
ORIGIN: Final = "at the world's origin"
NO_ACTORS: Final[tuple[str, ...]] = ("actor",)
STEPS: Final = {
    "wrists": (
        "**1.** Lay both hands flat on the calibration sheet, wrists on its marks and fingers along its lines.",
        "Hands are on the marks",
        viser.Icon.HAND_STOP,
    ),
    "fingertips": (
        "**2.** To measure their size, draw the hands back until the middle fingertips touch the centre line.",
        "Fingertips touch the line",
        viser.Icon.HAND_FINGER,
    ),
}
"""The instructions, the button's label and its icon, by step."""


class CalibrateTab:
    """Both steps of docs/calibration.md; each starts a countdown before its request."""

    def __init__(self, ask: Ask, gui: viser.GuiApi, perform: Perform) -> None:
        self._ask = ask
        self._props: dict[str, tuple[str, ...]] = {}
        """Names of props, by actor."""
        self._actor: viser.GuiDropdownHandle[str] = gui.add_dropdown("Actor", NO_ACTORS, visible=False)  # pyright: ignore
        self._sheet: viser.GuiDropdownHandle[str] = gui.add_dropdown(  # pyright: ignore
            "Sheet position",
            (ORIGIN,),
            hint="Under a prop: the prop stands on the sheet's centre with its x axis to the right. "
            "For any other place, run manipnet calibrate --at X Y Z --yaw DEGREES",
        )
        for step, (text, label, icon) in STEPS.items():
            gui.add_markdown(f"{text}\n\n![{label}]({step}.png)", image_root=Path(__file__).parent)
            button = gui.add_button(label, icon=icon, hint=f"Then keep still for {COUNTDOWN_S} s")
            button.on_click(lambda _, step=step, button=button: perform(lambda: self._calibrate(step, button)))
        self._result = gui.add_markdown("")

    def refresh(self, bodies: dict[str, dict[str, Any]]) -> None:
        """Update the lists of actors and props from the props by body and actor."""
        props = {actor: tuple(carried) for actor, carried in bodies.items()}
        if props == self._props:
            return
        self._props = props
        self._actor.options, self._actor.visible = tuple(props), len(props) > 1
        names = dict.fromkeys(name for carried in props.values() for name in carried)
        self._sheet.options = (ORIGIN, *(f"under {name}" for name in names))

    def _calibrate(self, step: str, button: viser.GuiButtonHandle) -> None:
        request = {"op": "calibrate", "step": step, "actor": self._actor.value}
        if self._sheet.value != ORIGIN:
            request["reference"] = self._sheet.value.removeprefix("under ")
        label, button.disabled, self._result.content = button.label, True, ""
        try:
            for left in range(COUNTDOWN_S, 0, -1):
                button.label = f"Keep still … {left}"
                time.sleep(1.0)
            self._result.content = report(self._ask(**request))
        finally:
            button.label, button.disabled = label, False


def report(answer: dict[str, Any]) -> str:
    """The text that shows the server's answer."""
    lines = [
        f"**{answer['quality'].capitalize()}**: the hands are {answer['hand_scale']:.3f} times the size of the model's",
        "",
    ]
    if answer["hands"]:
        lines += ["| | held still within | changed by |", "|---|--:|--:|"]
    for part, hand in answer["hands"].items():
        still, changed = (f"{hand[f'{what}_mm']:.1f} mm, {hand[f'{what}_deg']:.1f}°" for what in ("spread", "changed"))
        lines.append(f"| {part} | {still} | {changed} |")
    saved = f"Saved in `{Path(answer['stored']).name}`" if answer.get("stored") else answer.get("note", "")
    return "\n".join([*lines, "", saved])
