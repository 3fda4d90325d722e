"""The tab that calibrates the hands on a printed sheet, and shows how good the calibration is."""

import time
from pathlib import Path
from typing import Any, Final

import viser

from manipnet.page.controls import Ask, Perform, at_once
from manipnet.page.markdown import escape

COUNTDOWN_S: Final = 3
"""From the click to the request. The request uses the last 2 s, in which the hand that clicked must lie still."""
ORIGIN: Final = "at the world's origin"
PLACES: Final[tuple[str, ...]] = (ORIGIN,)
NO_ACTOR: Final[tuple[str, ...]] = ("actor",)
STEPS: Final = {
    "wrists": (
        "**1** Lay both hands flat on the calibration sheet: the wrists on its marks, the fingers along its lines.",
        "The hands are on the marks",
        viser.Icon.HAND_STOP,
    ),
    "fingertips": (
        "**2** To measure the size of the hands, draw them back until the middle fingertips touch the centre line.",
        "The fingertips touch the line",
        viser.Icon.HAND_FINGER,
    ),
}
"""The text, the button and its icon for each step."""


class CalibrateTab:
    """The two steps of docs/calibration.md. Each runs a few seconds after the click."""

    def __init__(self, ask: Ask, gui: viser.GuiApi, perform: Perform) -> None:
        self._ask = ask
        self._props: dict[str, tuple[str, ...]] = {}
        """The props of each actor."""
        self._actor: viser.GuiDropdownHandle[str] = gui.add_dropdown("Actor", NO_ACTOR, visible=False)  # pyright: ignore
        self._sheet: viser.GuiDropdownHandle[str] = gui.add_dropdown(  # pyright: ignore
            "Sheet position",
            PLACES,
            hint="under a prop: the prop stands on the centre of the sheet, with its x axis to the right; "
            "for any other place, run manipnet calibrate --at X Y Z --yaw DEGREES",
        )
        self._actor.on_update(at_once(self._offer_places))
        for step, (text, label, icon) in STEPS.items():
            gui.add_markdown(f"{text}\n\n![{label}]({step}.png)", image_root=Path(__file__).parent)
            button = gui.add_button(label, icon=icon, hint=f"then keep your hands still for {COUNTDOWN_S} s")
            button.on_click(lambda _, step=step, button=button: perform(lambda: self._calibrate(step, button)))
        self._result = gui.add_markdown("")

    def refresh(self, bodies: dict[str, dict[str, Any]]) -> None:
        """Offer the actors and the props that exist now, as the server lists them."""
        props = {actor: tuple(carried) for actor, carried in bodies.items()}
        if props == self._props:
            return
        self._props = props
        self._actor.options, self._actor.visible = tuple(props), len(props) > 1
        self._offer_places()

    def _offer_places(self) -> None:
        """Offer the props of the chosen actor, under which the sheet can lie."""
        self._sheet.options = (*PLACES, *(f"under {name}" for name in self._props.get(self._actor.value, ())))

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
    """The result of a calibration as Markdown."""
    lines = [
        f"**{answer['quality'].capitalize()}**: the hands are {answer['hand_scale']:.3f} times as large as the model's",
        "",
    ]
    if answer["hands"]:
        lines += ["| | moved within | changed by |", "|---|--:|--:|"]
    for part, hand in answer["hands"].items():
        still, changed = (f"{hand[f'{what}_mm']:.1f} mm, {hand[f'{what}_deg']:.1f}°" for what in ("spread", "changed"))
        lines.append(f"| {escape(part)} | {still} | {changed} |")
    kept = (
        f"stored in {escape(Path(answer['stored']).name)}" if answer.get("stored") else escape(answer.get("note", ""))
    )
    return "\n".join([*lines, "", kept])
