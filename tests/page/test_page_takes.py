"""Takes on the live page: recorded, shown, described, downloaded, renamed and deleted in a real browser."""

import json

from browser import another
from studio import PATIENCE_S, SECOND, TEXT, Studio

from manipnet.page.takes_tab import LOOK_EVERY_S
from manipnet.recording.mcap_file import read_hands

LAYER = "+getComputedStyle(document.querySelector('%s')).zIndex"
"""How near to the viewer an element is drawn."""
NAMED = "[...document.querySelectorAll('input')].filter(one => one.value === '%s').length"


def test_a_take_is_recorded_with_keys_and_shown_to_one_visitor_only(studio: Studio) -> None:
    page = studio.page
    studio.open("Takes")
    page.type("Slate", "", enter=False)
    page.keys("1", "2", "A", "Tab", "3")  # a browser that was busy catches up with what was typed
    studio.says("Record makes: 12A take 3")
    page.type("Number", "1")
    studio.says("Record makes: 12A take 1")
    page.click("Next take")  # leaves the field
    page.key("r")
    page.wait_for("document.querySelector('.mn-recording') !== null", PATIENCE_S)
    studio.says("REC 0:0")
    page.click("Stop recording 0:", PATIENCE_S, whole=False)
    page.wait_for("document.querySelector('.mn-recording') === null", PATIENCE_S)
    page.wait_for("[...document.querySelectorAll('input')].some(one => one.value === '12A take 1.mcap')", PATIENCE_S)
    take = studio.takes / "12A take 1.mcap"
    assert sum(1 for _ in read_hands(take)) > 0
    studio.says("Record makes: 12A take 2")
    page.click("Show this take")
    studio.says(f"▶ {take.name}")
    with another(page) as other:
        other.wait_for(f"{TEXT}.includes('● Live')", PATIENCE_S)
        assert not other.evaluate(f"{TEXT}.includes('Back to live')")
    page.type("Time, s", "0.02")
    page.click("Play")
    page.wait_for(f"{TEXT}.includes('Pause playback')", PATIENCE_S)
    page.key(" ")
    page.wait_for(f"!{TEXT}.includes('Pause playback')", PATIENCE_S)
    page.type("Time, s", "0")
    page.click("Next take")
    page.key("ArrowRight")
    page.wait_for(f"{SECOND} === '0.02'", PATIENCE_S)
    page.key("ArrowLeft")
    page.wait_for(f"{SECOND} === '0'", PATIENCE_S)
    page.click("Back to live")
    studio.says("● Live")
    page.click("Show this take")
    studio.says(f"▶ {take.name}")
    page.call("Page.reload")
    studio.says("● Live")


def test_the_record_button_begins_a_recording_and_r_ends_it(studio: Studio) -> None:
    page = studio.page
    studio.open("Takes")
    page.type("Slate", "", enter=False)
    studio.says("Record makes: take, with date and time")
    page.click("Record")
    page.wait_for("document.querySelector('.mn-recording') !== null", PATIENCE_S)
    take = studio.server.ask({"op": "recordings"})["recording"]["name"]
    page.choose("Take", take)
    page.wait_for(NAMED % take.removesuffix(".mcap"), PATIENCE_S)
    page.type("Note", "so far", field="textarea", enter=False)
    studio.settle(LOOK_EVERY_S + 1.0)  # the file grows, and the page looks at it
    assert page.evaluate("[...document.querySelectorAll('textarea')].some(one => one.value === 'so far')")
    page.click("Next take")  # leaves the field
    page.key("r")
    page.wait_for("document.querySelector('.mn-recording') === null", PATIENCE_S)
    studio.until(lambda _: list(studio.takes.glob("take *.mcap")))
    (dated,) = studio.takes.glob("take *.mcap")
    dated.rename(studio.takes / "spare.mcap")


def test_keys_do_nothing_while_somebody_types(studio: Studio) -> None:
    page = studio.page
    studio.open("Takes")
    page.choose("Take", "12A take 1.mcap")
    page.wait_for(NAMED % "12A take 1", PATIENCE_S)
    page.type("Note", "ran r r", field="textarea", enter=False)
    page.key("r")
    studio.settle()
    page.click("Keep changes")
    studio.says("note kept")
    assert studio.server.ask({"op": "recordings"})["recording"] is None


def test_a_take_is_described_downloaded_renamed_and_deleted(studio: Studio) -> None:
    page = studio.page
    studio.open("Takes")
    page.choose("Take", "spare.mcap")
    page.wait_for(NAMED % "spare", PATIENCE_S)
    page.choose("Take", "12A take 1.mcap")
    page.wait_for(NAMED % "12A take 1", PATIENCE_S)
    for field, text in {"Name": "best of all", "Its slate": "12B", "Its number": "3"}.items():
        page.type(field, text, enter=False)
    studio.settle()
    assert not list(studio.takes.glob("b*"))  # not renamed letter by letter
    page.click("Keep changes")
    studio.until(lambda _: notes_of(studio, "best of all") == {"slate": "12B", "number": 3, "note": "ran r rr"})
    page.call("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(studio.rig.parent))
    page.click("Download")
    copy = studio.rig.parent / "best of all.mcap"
    studio.until(lambda _: copy.exists() and copy.stat().st_size == (studio.takes / copy.name).stat().st_size)
    page.click("Delete …")
    studio.says("cannot be brought back")
    assert page.evaluate(f"{LAYER % '.mantine-Notifications-root'} < {LAYER % '.mantine-Modal-overlay'}")
    page.click("Keep it", PATIENCE_S)
    page.wait_for(f"!{TEXT}.includes('cannot be brought back')", PATIENCE_S)
    page.click("Delete …")
    page.click("Delete it", PATIENCE_S)
    studio.until(lambda _: [file.name for file in studio.takes.iterdir()] == ["spare.mcap"])


def notes_of(studio: Studio, take: str) -> dict:
    """What is kept about a take; nothing before it has that name."""
    file = studio.takes / f"{take}.json"
    return json.loads(file.read_text()) if file.exists() else {}
