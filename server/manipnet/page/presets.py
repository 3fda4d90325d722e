"""Presets: what a visitor sees, the look-ahead, and what the bodies carry, under a name and kept in his browser."""

import json
import math
from typing import Any, Final

import viser

from manipnet.page.controls import Ask, Perform, remembered
from manipnet.page.view_tab import ViewTab

KEY: Final = "presets"
NONE: Final[str] = "none"
LONGEST_NAME: Final = 40
MOST: Final = 50


class Presets:
    """Saves, uses and deletes presets. Only an operator's presets change the look-ahead and the objects."""

    def __init__(self, ask: Ask, client: viser.ClientHandle, view: ViewTab, perform: Perform, operator: bool) -> None:
        self._ask, self._client, self._view, self._operator = ask, client, view, operator
        self._presets = dict[str, dict[str, Any]]()
        gui = client.gui
        gui.add_markdown("**Presets**")
        self._chosen: viser.GuiDropdownHandle[str] = gui.add_dropdown("Preset", (NONE,))  # pyright: ignore
        use = gui.add_button("Use this preset", icon=viser.Icon.CHECK)
        self._name = gui.add_text("New preset", "", hint="a name under which this browser keeps what is set now")
        save = gui.add_button(
            "Save preset",
            icon=viser.Icon.BOOKMARK,
            hint="camera, theme and layers" + (", look-ahead, and the objects with their places" if operator else ""),
        )
        delete = gui.add_button("Delete this preset", icon=viser.Icon.TRASH, color="gray")
        for button, action in ((use, self._use), (save, self._save), (delete, self._delete)):
            button.on_click(lambda _, action=action: perform(action))

    def remember(self) -> None:
        """Offer what this browser has kept; waits for its answer."""
        if kept := read_presets(remembered(self._client, KEY)):
            self._presets = {**kept, **self._presets}
            self._offer()

    def _save(self) -> str:
        name = self._name.value.strip()
        if not 0 < len(name) <= LONGEST_NAME or name == NONE:
            raise ValueError(f"give the new preset a name of 1 to {LONGEST_NAME} characters other than {NONE!r}")
        if name not in self._presets and len(self._presets) >= MOST:
            raise ValueError(f"there are {MOST} presets, which is the most that are kept; delete one first")
        preset: dict[str, Any] = {"view": self._view.state()}
        if self._operator:
            preset["look_ahead_s"] = self._view.look_ahead_s
            preset["objects"] = self._ask(op="objects")["bodies"]
        self._presets = {**self._presets, name: preset}
        self._keep()
        self._chosen.value, self._name.value = name, ""
        return f"preset {name} is kept in this browser"

    def _use(self) -> str:
        name, preset = self._choice()
        self._view.restore(preset.get("view", {}))
        if self._operator:
            if "look_ahead_s" in preset:
                self._ask(op="look_ahead", seconds=preset["look_ahead_s"])
            for actor, props in preset.get("objects", {}).items():
                for body, prop in props.items():
                    self._carry({"actor": actor, "body": body}, prop)
        return f"preset {name} is in use"

    def _carry(self, about: dict[str, str], prop: dict[str, Any]) -> None:
        self._ask(op="select_object", object=prop["object"], scale=prop["scale"], **about)
        self._ask(op="place_object", position=prop["position"], rotation=prop["rotation"], **about)

    def _delete(self) -> str:
        name, _ = self._choice()
        self._presets = {other: preset for other, preset in self._presets.items() if other != name}
        self._keep()
        return f"preset {name} is deleted"

    def _choice(self) -> tuple[str, dict[str, Any]]:
        name = self._chosen.value
        if name not in self._presets:
            raise ValueError("there is no preset yet; name one under New preset, and save it")
        return name, self._presets[name]

    def _keep(self) -> None:
        self._client.local_storage.set_item(KEY, json.dumps(self._presets))
        self._offer()

    def _offer(self) -> None:
        self._chosen.options = tuple(self._presets) or (NONE,)


def read_presets(text: str | None) -> dict[str, dict[str, Any]]:
    """The presets in what a browser has kept, by name. What another version or program wrote there is left out."""
    try:
        kept = json.loads(text or "{}")
    except ValueError:
        return {}
    if not isinstance(kept, dict):
        return {}
    return {name: preset for name, preset in kept.items() if name != NONE and _is_preset(preset)}


def _is_preset(preset: Any) -> bool:
    """Whether a value has the form of a preset; the server checks what is for it when it is used."""
    if not isinstance(preset, dict) or not isinstance(view := preset.get("view"), dict):
        return False
    camera = view.get("camera") or {"position": (0, 0, 0), "look_at": (0, 0, 0)}
    props = [prop for actor in _values(preset.get("objects", {})) for prop in _values(actor)]
    return (
        isinstance(view.get("layers", []), list)
        and isinstance(camera, dict)
        and all(_is_point(camera.get(key)) for key in ("position", "look_at"))
        and all(isinstance(prop, dict) and {"object", "scale", "position", "rotation"} <= prop.keys() for prop in props)
    )


def _is_point(value: Any) -> bool:
    return (
        isinstance(value, list | tuple)
        and len(value) == 3
        and all(isinstance(one, int | float) and math.isfinite(one) for one in value)
    )


def _values(table: Any) -> list[Any]:
    """The values of a table; a value that is not a table counts as one that does not fit."""
    return list(table.values()) if isinstance(table, dict) else [None]
