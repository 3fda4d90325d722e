"""The tab that chooses the hand of each actor."""

from typing import Any, Final

import viser

from manipnet.page.controls import Fields, Perform, at_once, by_visitor
from manipnet.page.hand_choices import OWN, HandChoices

NO_ACTOR: Final[tuple[str, ...]] = ("actor",)


class HandsTab:
    """The model's hand, the shipped ones, and those that were dropped on the page."""

    def __init__(self, choices: HandChoices, gui: viser.GuiApi, perform: Perform) -> None:
        self._choices, self._perform = choices, perform
        self._actor: viser.GuiDropdownHandle[str] = gui.add_dropdown("Actor", NO_ACTOR, visible=False)  # pyright: ignore
        self._hand: viser.GuiDropdownHandle[str] = gui.add_dropdown("Hand", (OWN,))  # pyright: ignore
        self._fields = Fields(self._hand)
        gui.add_markdown(
            "Contact is solved on the chosen hand, and everybody sees it. To use an avatar of yours, drop its file on "
            "the page: **VRM**, or **GLB** with a skeleton. `manipnet hand import` says more about a file."
        )
        self._actor.on_update(at_once(self._show))
        self._hand.on_update(by_visitor(lambda: perform(self._choose)))

    @property
    def actor(self) -> str:
        """The chosen actor."""
        return self._actor.value

    def refresh(self, status: dict[str, Any]) -> None:
        """Offer the actors and the hands that exist now."""
        actors = tuple(status["actors"])
        if self._actor.options != actors:
            self._actor.options, self._actor.visible = actors, len(actors) > 1
        self._choices.keep({(name, actor) for name, actor in status["hand_profiles"]})
        if self._fields.settled:
            self._show()

    def use(self, hand: str) -> str:
        """Let the chosen actor have a hand. Raises `RefusedError`."""
        self._choices.choose(self.actor, hand, len(self._actor.options) > 1)
        self._show()
        return f"{self.actor} has {hand}" if hand == OWN else f"{self.actor} has the hand {hand}"

    def _choose(self) -> str:
        return self.use(self._hand.value)

    def _show(self) -> None:
        if self._hand.options != (names := self._choices.names()):
            self._hand.options = names
        if self._hand.value != (shown := self._choices.of(self.actor)):
            self._fields.write(self._hand, shown)
