"""The tab about what a visitor sees: camera, look-ahead, theme and layers. All but the look-ahead is his own."""

from typing import Any, Final

import viser

from manipnet.page.controls import Ask, Fields, Perform, by_visitor, remembered
from manipnet.page.framing import FollowCamera
from manipnet.page.html import legend
from manipnet.page.overlays import LAYERS, OVERLAYS
from manipnet.page.show import Show

THEME: Final = "theme"
ACCENT: Final = (56, 132, 222)


class ViewTab:
    """Camera, theme and layers of one visitor; an operator also sets the look-ahead."""

    def __init__(
        self, ask: Ask, show: Show, client: viser.ClientHandle, camera: FollowCamera, perform: Perform, operator: bool
    ) -> None:
        self._show, self._client, self._camera = show, client, camera
        self._dark = True
        self._nodes: dict[str, viser.FrameHandle] = {}
        """The visitor's own node above each layer. It is hidden and never removed: the browser would remove what
        others have drawn below it."""
        self._layers = frozenset[str]()
        self._boxes: dict[str, viser.GuiCheckboxHandle] = {}
        self.look_ahead_s = 0.0
        """The look-ahead that is in force."""
        gui = client.gui
        self._look_ahead: viser.GuiSliderHandle[int] | None = None
        if operator:
            slider = gui.add_slider("Look-ahead, ms", 0, 500, 10, initial_value=500)
            slider.on_update(
                by_visitor(lambda: perform(lambda: _nothing(ask(op="look_ahead", seconds=1e-3 * slider.value))))
            )
            self._look_ahead, self._fields = slider, Fields(slider)
        self._follow = gui.add_button(
            "Follow the hands", icon=viser.Icon.FOCUS_2, hint="key C; the camera follows until you move it"
        )
        self._follow.on_click(lambda _: self.follow())
        gui.add_command("Follow the hands", hotkey="C").on_trigger(lambda _: self.follow())
        self._theme = gui.add_button("Light theme", icon=viser.Icon.SUN)
        self._theme.on_click(lambda _: self._switch_theme())
        gui.add_markdown("**Layers**")
        for name, layer in OVERLAYS.items():
            self._nodes[name] = client.scene.add_frame(f"{LAYERS}/{name}", show_axes=False, visible=False)
            box = self._boxes[name] = gui.add_checkbox(layer.label, False)
            gui.add_html(legend(layer))
            box.on_update(lambda event, name=name: self._set_layer(name, event.target.value))
        self._apply_theme()

    def refresh(self, look_ahead_s: float) -> None:
        """Show whether the camera follows, and the look-ahead that is in force."""
        self.look_ahead_s = look_ahead_s
        self._follow.disabled = self._camera.following
        slider = self._look_ahead
        if slider is not None and abs(slider.value - 1e3 * look_ahead_s) > 0.5 and self._fields.settled:
            self._fields.write(slider, round(1e3 * look_ahead_s))

    def follow(self) -> None:
        """Give the camera back."""
        self._show.settle()
        self._camera.restart()
        self._follow.disabled = True

    def state(self) -> dict[str, Any]:
        """Theme, layers and camera, for a preset; a camera that follows is None."""
        return {"dark": self._dark, "layers": sorted(self._layers), "camera": self._camera.state()}

    def restore(self, state: dict[str, Any]) -> None:
        """Return to what `state` returned; what is missing stays as it is."""
        if state.get("dark", self._dark) != self._dark:
            self._switch_theme()
        if "layers" in state:
            for name, box in self._boxes.items():
                box.value = name in state["layers"]
        if state.get("camera"):
            self._camera.stand(state["camera"]["position"], state["camera"]["look_at"])
        elif "camera" in state:
            self.follow()

    def close(self) -> None:
        """Forget the layers: the visitor has left."""
        self._show.want_layers(self._client.client_id, frozenset())

    def _set_layer(self, name: str, visible: bool) -> None:
        self._layers = self._layers | {name} if visible else self._layers - {name}
        self._show.want_layers(self._client.client_id, self._layers)
        self._nodes[name].visible = visible

    def _switch_theme(self) -> None:
        self._dark = not self._dark
        # kept first: whoever sees the theme may reload the page at once
        self._client.local_storage.set_item(THEME, "dark" if self._dark else "light")
        self._apply_theme()

    def remember(self) -> None:
        """Use the theme that this browser used before; waits for its answer."""
        if remembered(self._client, THEME) == "light":
            self._dark = False
            self._apply_theme()

    def _apply_theme(self) -> None:
        self._client.gui.configure_theme(
            dark_mode=self._dark,
            show_logo=False,
            show_share_button=False,
            brand_color=ACCENT,
            control_width="medium",
        )
        self._theme.label = "Light theme" if self._dark else "Dark theme"
        self._theme.icon = viser.Icon.SUN if self._dark else viser.Icon.MOON


def _nothing(_: object) -> None:
    return None
