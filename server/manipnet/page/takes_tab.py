"""The tab that names the next take, and keeps the takes: show, describe, rename, download and delete."""

import time
from pathlib import Path
from typing import Any, Final

import viser

from manipnet.page.controls import Ask, Perform, at_once
from manipnet.page.markdown import escape
from manipnet.page.playback import read_recording
from manipnet.page.transport import Transport

NONE: Final[str] = "none"
LOOK_EVERY_S: Final = 2.0
"""The folder is read this often, and after every change that is made here."""


class TakesTab:
    """Slate and number of the next take, and everything about those in the folder."""

    def __init__(self, ask: Ask, client: viser.ClientHandle, transport: Transport, perform: Perform) -> None:
        self._ask, self._client, self._transport, self._perform = ask, client, transport, perform
        self._folder, self._takes = Path(), dict[str, dict[str, Any]]()
        self._looked_s = float("-inf")
        self._shown: dict[str, Any] | None = None
        """What the fields show, which a visitor may be changing."""
        self._offered = 1
        """The number of the next take that its field shows, unless a visitor has just changed it."""
        self._asks = False
        """Whether the question is open that a deletion asks first."""
        gui = client.gui
        gui.add_markdown("**Next take**")
        self._slate = gui.add_text("Slate", "", hint="with a slate, takes are called SLATE take NUMBER")
        self._number = gui.add_number("Number", 1, min=0, max=9999, step=1)
        self._preview = gui.add_markdown("")
        gui.add_markdown("**Takes**")
        self._take = gui.add_dropdown("Take", (NONE,))
        self._facts = gui.add_markdown("")
        show = gui.add_button("Show this take", icon=viser.Icon.MOVIE)
        with gui.add_form(None) as form:  # fields change with every letter, but a file must not be renamed so often
            self._name = gui.add_text("Name", "")
            self._own_slate = gui.add_text("Its slate", "")
            self._own_number = gui.add_number("Its number", 0, min=0, max=9999, step=1)
            self._note = gui.add_text("Note", "", multiline=True)
            keep = gui.add_button("Keep changes", icon=viser.Icon.CHECK, hint="Enter, except in the note")
        download = gui.add_button("Download", icon=viser.Icon.DOWNLOAD)
        delete = gui.add_button("Delete …", icon=viser.Icon.TRASH, color="gray")
        show.on_click(lambda _: perform(self._show_take))
        download.on_click(lambda _: perform(self._download))
        delete.on_click(lambda _: self._confirm_delete())
        self._take.on_update(at_once(self._show_facts))
        for handle in (self._slate, self._number):
            handle.on_update(at_once(self._name_next))
        keep.on_click(lambda _: form.submit())
        form.on_submit(lambda _: perform(self._edit))

    def refresh(self) -> None:
        """Offer the takes in the folder."""
        self._show_next()
        if time.monotonic() - self._looked_s > LOOK_EVERY_S:
            self._look()

    def _look(self) -> None:
        self._looked_s = time.monotonic()
        answer = self._ask(op="recordings", notes=True)
        self._folder = Path(answer["folder"])
        self._takes = {take["name"]: take for take in answer["takes"]}
        names = tuple(self._takes) or (NONE,)
        if self._take.options != names:
            self._take.options = names
        self._show_facts()

    def _show_facts(self) -> None:
        """Show the chosen take. Its size changes while it is recorded, and what a visitor types meanwhile stays."""
        take = self._takes.get(self._take.value)
        if take is None:
            self._facts.content = f"Takes are saved in {escape(self._folder)}"
        else:
            recorded = time.strftime("%Y-%m-%d %H:%M", time.localtime(take["changed_s"]))
            self._facts.content = f"{recorded} · {take['bytes'] / 1e6:.1f} MB in {escape(self._folder)}"
        if (about := _about(take or {"name": ""})) != self._shown:
            self._name.value, self._own_slate.value = about["name"], about["slate"]
            self._own_number.value, self._note.value = about["number"], about["note"]
        self._shown = about

    def _name_next(self) -> None:
        slate, self._offered = self._slate.value.strip(), int(self._number.value)
        self._transport.about = {"slate": slate, "number": self._offered} if slate else {}
        self._show_next()

    def _show_next(self) -> None:
        about = self._transport.about
        if about and about["number"] != self._offered:  # a recording has begun, and the next one has the next number
            self._offered = self._number.value = about["number"]
        name = f"{about['slate']} take {about['number']}" if about else "take, with date and time"
        if self._preview.content != (text := f"Record makes: {escape(name)}"):
            self._preview.content = text

    def _chosen(self) -> dict[str, Any]:
        if self._take.value not in self._takes:
            raise ValueError("there is no take yet; press Record")
        return self._takes[self._take.value]

    def _show_take(self) -> None:
        self._transport.show(read_recording(self._folder / self._chosen()["name"]))

    def _edit(self) -> str | None:
        take = self._chosen()
        before = _about(take)
        fields = {"name": self._name, "slate": self._own_slate, "number": self._own_number, "note": self._note}
        changes = {key: field.value for key, field in fields.items() if field.value != before[key]}
        if not changes:
            return None
        answer = self._ask(op="edit_recording", recording=take["name"], **changes)
        self._look()
        self._take.value = answer["name"]
        self._show_facts()
        return f"{answer['name']}: {' and '.join(changes)} kept"

    def _download(self) -> None:  # viser itself shows how far the download is
        take = self._chosen()
        self._client.send_file_download(take["name"], (self._folder / take["name"]).read_bytes(), save_immediately=True)

    def _confirm_delete(self) -> None:
        take = self._takes.get(self._take.value)
        if take is None or self._asks:
            return
        self._asks = True
        gui = self._client.gui
        modal = gui.add_modal("Delete this take?")
        with modal:
            gui.add_markdown(f"**{escape(take['name'])}** ({take['bytes'] / 1e6:.1f} MB) cannot be brought back.")
            delete = gui.add_button("Delete it", icon=viser.Icon.TRASH, color="red")
            keep = gui.add_button("Keep it", color="gray")

        def end(confirmed: bool) -> None:
            if modal.closed:  # by the first click of a double click
                return
            modal.close()
            self._asks = False
            if confirmed:
                self._perform(lambda: self._delete(take["name"]))

        delete.on_click(lambda _: end(True))
        keep.on_click(lambda _: end(False))

    def _delete(self, name: str) -> str:
        self._ask(op="delete_recording", recording=name)
        self._look()
        self._show_facts()
        return f"{name} is deleted"


def _about(take: dict[str, Any]) -> dict[str, Any]:
    """Name, slate, number and note of a take, as the fields show them."""
    return {"name": take["name"].removesuffix(".mcap"), "slate": "", "number": 0, "note": ""} | {
        key: take[key] for key in ("slate", "number", "note") if key in take
    }
