"""The tab in which hands are calibrated: what to show, where the sheet lies, and how good it was."""

import time
from pathlib import Path
from typing import Any, Final

import viser

from manipnet.page.controls import Ask, Perform

COUNTDOWN_S: Final = 3
"""From the click to the request, which looks back 2 s: the hand that clicked must lie still by then."""
ORIGIN: Final = "at the world's origin"
PLACES: Final[tuple[str, ...]] = (ORIGIN,)
NOBODY: Final[tuple[str, ...]] = ("actor",)
STEPS: Final = {
    "wrists": (
        "**1** Both hands flat on the calibration sheet, wrists on its marks, fingers along its lines.",
        "Hands are on the marks",
        viser.Icon.HAND_STOP,
    ),
    "fingertips": (
        "**2** For the size of the hands: drawn back until the middle fingertips touch the centre line.",
        "Fingertips touch the line",
        viser.Icon.HAND_FINGER,
    ),
}
"""What is shown in each step, and what its button says."""


class CalibrateTab:
    """Both steps of docs/calibration.md, each asked for a little after the click."""

    def __init__(self, ask: Ask, gui: viser.GuiApi, perform: Perform) -> None:
        self._ask = ask
        self._props: dict[str, tuple[str, ...]] = {}
        """By actor."""
        self._whose: viser.GuiDropdownHandle[str] = gui.add_dropdown("Whose", NOBODY, visible=False)  # pyright: ignore
        self._sheet: viser.GuiDropdownHandle[str] = gui.add_dropdown(  # pyright: ignore
            "Sheet lies",
            PLACES,
            hint="under a prop: it stands on the sheet's centre, its x axis to the right; "
            "elsewhere: manipnet calibrate --at X Y Z --yaw DEGREES",
        )
        for step, (text, label, icon) in STEPS.items():
            gui.add_markdown(f"{text}\n\n![{label}]({step}.png)", image_root=Path(__file__).parent)
            button = gui.add_button(label, icon=icon, hint=f"then keep still for {COUNTDOWN_S} s")
            button.on_click(lambda _, step=step, button=button: perform(lambda: self._calibrate(step, button)))
        self._told = gui.add_markdown("")

    def refresh(self, bodies: dict[str, dict[str, Any]]) -> None:
        """Offer whom and what there is now: props by actor."""
        props = {actor: tuple(carried) for actor, carried in bodies.items()}
        if props == self._props:
            return
        self._props = props
        self._whose.options, self._whose.visible = tuple(props), len(props) > 1
        names = dict.fromkeys(name for carried in props.values() for name in carried)
        self._sheet.options = (*PLACES, *(f"under {name}" for name in names))

    def _calibrate(self, step: str, button: viser.GuiButtonHandle) -> None:
        request = {"op": "calibrate", "step": step, "actor": self._whose.value}
        if self._sheet.value != ORIGIN:
            request["reference"] = self._sheet.value.removeprefix("under ")
        label, button.disabled, self._told.content = button.label, True, ""
        try:
            for left in range(COUNTDOWN_S, 0, -1):
                button.label = f"Keep still … {left}"
                time.sleep(1.0)
            self._told.content = report(self._ask(**request))
        finally:
            button.label, button.disabled = label, False


def report(answer: dict[str, Any]) -> str:
    """What came of it."""
    lines = [f"**{answer['quality'].capitalize()}**: hands {answer['hand_scale']:.3f} times the model's", ""]
    if answer["hands"]:
        lines += ["| | still within | changed by |", "|---|--:|--:|"]
    for part, hand in answer["hands"].items():
        still, changed = (f"{hand[f'{what}_mm']:.1f} mm, {hand[f'{what}_deg']:.1f}°" for what in ("spread", "changed"))
        lines.append(f"| {part} | {still} | {changed} |")
    kept = f"kept in `{Path(answer['stored']).name}`" if answer.get("stored") else answer.get("note", "")
    return "\n".join([*lines, "", kept])
