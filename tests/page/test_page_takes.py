"""Takes on the live page: recorded, shown, described, downloaded, renamed and deleted in a real browser."""

from browser import another
from studio import PATIENCE_S, SECOND, TEXT, Studio

from manipnet.recording.mcap_file import read_hands


def test_a_take_is_recorded_with_keys_and_shown_to_one_visitor_only(studio: Studio) -> None:
    page = studio.page
    page.click("Takes")
    page.type("Slate", "12A")
    studio.says("Record makes: 12A take 1")
    page.click("Next take")  # leaves the field
    page.key("r")
    page.wait_for("document.querySelector('.mn-recording') !== null", PATIENCE_S)
    studio.says("REC 0:0")
    page.wait_for("document.body.innerText.includes('Stop recording 0:0')", PATIENCE_S)
    page.key("r")
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


def test_keys_do_nothing_while_somebody_types(studio: Studio) -> None:
    page = studio.page
    page.click("Takes")
    page.wait_for("[...document.querySelectorAll('input')].some(one => one.value.startsWith('12A take 1'))", PATIENCE_S)
    page.type("Note", "ran r r", field="textarea", enter=False)
    page.key("r")
    page.click("Keep changes")
    studio.says("note kept")
    assert studio.server.ask({"op": "recordings"})["recording"] is None
