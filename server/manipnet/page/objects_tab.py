"""The tab that selects, scales, places and imports the objects of the props."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import viser

from manipnet.config.settings import SCALE_RANGE
from manipnet.geometry import Array, quat_exp, quat_log
from manipnet.page.controls import Ask, Fields, Perform, at_once, by_visitor
from manipnet.page.frames import Frame
from manipnet.page.gizmo import Gizmo
from manipnet.page.markdown import escape
from manipnet.synthesis.objects.mesh import FORMATS
from manipnet.synthesis.objects.units import UNITS_M

NONES: Final[tuple[str, ...]] = ("none",)
MOST_UNDONE: Final = 50
MAX_PROBLEM: Final = 600
"""Characters of a problem with a mesh file that are shown."""


class ObjectsTab:
    """Lets an operator choose the object of each body, its size, and where it sits on the body."""

    def __init__(self, ask: Ask, client: viser.ClientHandle, perform: Perform) -> None:
        self._ask, self._perform, gui = ask, perform, client.gui
        self._gizmo = Gizmo(client.scene, self._drag)
        self._before: list[dict[str, Any]] = []
        """What the bodies carried before each change that this visitor made here, oldest first."""
        self._initial: dict[str, dict[str, Any]] = {}
        self._dragging = False
        self._carried: dict[str, dict[str, Any]] = {}
        self._shown: dict[str, Any] | None = None
        """The state of the selected body that the controls show."""
        self._body: viser.GuiDropdownHandle[str] = gui.add_dropdown("Body", NONES)  # pyright: ignore
        self._object: viser.GuiDropdownHandle[str] = gui.add_dropdown("Object", NONES)  # pyright: ignore
        self._scale = gui.add_slider("Size", *SCALE_RANGE, 0.05, initial_value=1.0)
        self._position = gui.add_vector3(
            "Position, mm", (0.0, 0.0, 0.0), step=1.0, hint="x, y, z in the frame of the body"
        )
        self._turn = gui.add_vector3(
            "Rotation, °", (0.0, 0.0, 0.0), step=1.0, hint="about the x, y and z axes of the body"
        )
        self._fields = Fields(self._object, self._scale, self._position, self._turn)
        self._drags = gui.add_checkbox(
            "Drag to move", False, hint="show arrows and rings in the scene that move the object on its body"
        )
        self._stand = gui.add_button(
            "The object is on the sheet",
            icon=viser.Icon.ARROW_BAR_TO_DOWN,
            hint="measure the position of the object on its body while the prop stands upright on the sheet's centre",
        )
        self._undo = gui.add_button("Undo", icon=viser.Icon.ARROW_BACK_UP, color="gray", disabled=True)
        self._reset = gui.add_button(
            "Reset", icon=viser.Icon.RESTORE, color="gray", hint="object, size and place as they were at the start"
        )
        self._save = gui.add_button(
            "Save to the rig file",
            icon=viser.Icon.DEVICE_FLOPPY,
            hint="keeps objects, sizes, places and the look-ahead for the next start",
        )
        self._undo.on_click(lambda _: self._perform(self._go_back))
        self._reset.on_click(lambda _: self._perform(self._start_over))
        self._save.on_click(lambda _: self._perform(self._save_rig))
        self._unit = gui.add_dropdown("Unit of the file", tuple(UNITS_M), initial_value="m")
        self._upload = gui.add_upload_button(
            "Import mesh …", icon=viser.Icon.UPLOAD, mime_type=",".join(FORMATS), hint=" ".join(FORMATS)
        )
        self._problems = gui.add_markdown("")
        self._stand.on_click(lambda _: self._perform(self._stand_on_sheet))
        self._body.on_update(at_once(self._show_body))
        for handle in (self._object, self._scale):
            handle.on_update(by_visitor(lambda: self._perform(self._select)))
        for handle in (self._position, self._turn):
            handle.on_update(by_visitor(lambda: self._perform(self._place)))
        self._upload.on_upload(lambda _: self._perform(self._import))

    def refresh(self, answer: dict[str, Any]) -> None:
        """Offer the bodies and objects that exist now, as the server lists them."""
        self._carried = {
            body if len(answer["bodies"]) == 1 else f"{actor}: {body}": {"actor": actor, "body": body, **prop}
            for actor, props in answer["bodies"].items()
            for body, prop in props.items()
        }
        self._initial = answer["initial"]
        self._undo.disabled = not self._before
        objects = tuple(answer["objects"])
        if self._object.options != objects:
            self._object.options = objects
        self._problems.content = "\n".join(
            f"⚠ {escape(text, MAX_PROBLEM)}\n" for text in answer.get("problems", {}).values()
        )
        bodies = tuple(self._carried) or NONES
        if self._body.options != bodies:
            self._body.options = bodies
            self._show_body()
        elif self._carried.get(self._body.value) != self._shown and self._fields.settled:
            self._show_body()  # a dropped file, the gizmo or a client changed it

    def follow(self, frames: Sequence[Frame]) -> None:
        """Move the gizmo to the selected prop in the live frames of all actors; without any it is hidden."""
        chosen = self._carried.get(self._body.value) if self._drags.value else None
        actor = None if chosen is None else chosen["actor"]
        frame = next((frame for frame in frames if frame.message.actor == actor), None)
        if frame is None or chosen is None:
            self._gizmo.follow(None, None)
            return
        offset = next((prop.offset for prop in frame.props if prop.name == chosen["body"]), None)
        pose = next((body.pose for body in frame.message.bodies if body.name == chosen["body"]), None)
        self._gizmo.follow(pose, offset)

    def _show_body(self) -> None:
        prop = self._carried.get(self._body.value)
        if prop is None:
            return
        self._shown = prop
        if prop["object"] in self._object.options:
            self._fields.write(self._object, prop["object"])
        self._fields.write(self._scale, min(max(prop["scale"], self._scale.min), self._scale.max))
        self._fields.write(self._position, np.round(1e3 * np.array(prop.get("position", (0.0, 0.0, 0.0))), 2))
        turn = np.degrees(quat_log(np.array(prop.get("rotation", (0.0, 0.0, 0.0, 1.0)))))
        self._fields.write(self._turn, np.round(turn, 2))

    def _chosen(self) -> dict[str, Any]:
        prop = self._carried.get(self._body.value)
        if prop is None:
            raise ValueError(
                "no body carries an object yet; name one in the rig file, or start the server with --mesh NAME=FILE"
            )
        return {"actor": prop["actor"], "body": prop["body"]}

    def _note(self) -> dict[str, Any]:
        """Remember what the chosen body carries, so that the change that follows can be undone; returns the body."""
        chosen = self._chosen()
        self._before = [*self._before[1 - MOST_UNDONE :], self._carried[self._body.value]]
        self._undo.disabled = False
        return chosen

    def _go_back(self) -> str | None:
        """Undo the last change of this visitor."""
        if not self._before:
            return None
        prop = self._before.pop()
        self._undo.disabled = not self._before
        return self._restore(prop)

    def _start_over(self) -> str:
        """Let the chosen body carry what it carried when the server started."""
        chosen = self._chosen()
        initial = self._initial.get(chosen["actor"], {}).get(chosen["body"])
        if initial is None:
            raise ValueError(f"{chosen['body']} carried nothing when the server started")
        self._note()
        return self._restore({**chosen, **initial})

    def _restore(self, prop: dict[str, Any]) -> str:
        about = {"actor": prop["actor"], "body": prop["body"]}
        self._ask(op="select_object", object=prop["object"], scale=prop["scale"], **about)
        self._ask(op="place_object", position=list(prop["position"]), rotation=list(prop["rotation"]), **about)
        return f"{prop['body']} carries {prop['object']} as before"

    def _save_rig(self) -> str:
        answer = self._ask(op="save_rig")
        return f"saved in {answer['stored']}; {answer['note']}"

    def _select(self) -> None:
        chosen = self._note()
        self._ask(op="select_object", object=self._object.value, scale=self._scale.value, **chosen)

    def _place(self) -> None:
        rotation = quat_exp(np.radians(self._turn.value))
        self._note()
        self._put(np.concatenate([1e-3 * np.array(self._position.value), rotation]))

    def _drag(self, offset: Array, last: bool) -> None:
        if not self._dragging:
            self._note()
        self._dragging = not last
        self._perform(lambda: self._put(offset, last))

    def _put(self, offset: Array, store: bool = True) -> None:
        place = {"position": offset[:3].tolist(), "rotation": offset[3:].tolist(), "store": store}
        self._ask(op="place_object", **place, **self._chosen())

    def _stand_on_sheet(self) -> None:
        self._ask(op="place_object", on_sheet=True, **self._note())

    def _import(self) -> str:
        file = self._upload.value
        return self.import_mesh(file.name, file.content)

    def import_mesh(self, name: str, content: bytes) -> str:
        """Import a mesh file and let the selected body carry it. Raises `RefusedError`."""
        chosen = self._note()
        with tempfile.TemporaryDirectory(prefix="manipnet-") as folder:
            path = Path(folder) / Path(name).name
            path.write_bytes(content)
            added = self._ask(op="add_object", file=str(path), unit=self._unit.value)
        self._ask(op="select_object", object=added["object"], scale=1.0, **chosen)
        return f"{chosen['body']} carries {added['object']}"
