"""What a visitor of the live page sees: camera, theme, and the layout on a tablet."""

import pytest
from studio import FOLLOWING, PATIENCE_S, STAGE, TEXT, Studio

CONTROLS = ("View", "Objects", "Hands", "Takes", "Calibrate")
MAIN_TABS = "[...document.querySelectorAll('[role=tab]')].filter(one => one.offsetParent)"
TABS = f"{MAIN_TABS}.map(one => [one.textContent, one.getBoundingClientRect().top])"
"""The tabs that are visible, and how far from the top they begin."""
WIDE_TABS = f"{MAIN_TABS}.filter(one => one.getBoundingClientRect().right > innerWidth).length"
"""How many tabs reach beyond the window."""

NAMED = "[...document.querySelectorAll('input')].filter(one => one.value === '%s').length"
CONTACTS = """(() => {
  let row = [...document.querySelectorAll('label')].find(one => one.textContent.trim() === 'Contacts');
  while (!row.querySelector('input[type=checkbox]')) row = row.parentElement;
  return row.querySelector('input[type=checkbox]').checked;
})()"""
"""Whether the layer is on."""


def test_the_camera_is_taken_and_given_back(studio: Studio) -> None:
    page = studio.page
    studio.open("View")
    page.wait_for(f"{FOLLOWING}", PATIENCE_S)
    x, y = page.evaluate(STAGE)
    page.drag((x, y + 120), (x + 90, y + 150))
    page.wait_for(f"!{FOLLOWING}", PATIENCE_S)
    page.click("Follow the hands")
    page.wait_for(f"{FOLLOWING}", PATIENCE_S)
    page.drag((x, y + 120), (x - 90, y + 150))
    page.wait_for(f"!{FOLLOWING}", PATIENCE_S)
    page.key("c")
    page.wait_for(f"{FOLLOWING}", PATIENCE_S)


def test_the_theme_is_light_or_dark_and_remembered(studio: Studio) -> None:
    page, scheme = studio.page, "document.documentElement.dataset.mantineColorScheme"
    studio.open("View")
    page.wait_for(f"{scheme} === 'dark'", PATIENCE_S)
    page.click("Light theme")
    page.wait_for(f"{scheme} === 'light'", PATIENCE_S)
    page.call("Page.reload")
    studio.wait_until_it_stands()
    page.wait_for(f"{scheme} === 'light'", PATIENCE_S)
    page.click("Dark theme", PATIENCE_S)
    page.wait_for(f"{scheme} === 'dark'", PATIENCE_S)


def test_presets_keep_what_is_seen_and_what_the_bodies_carry(studio: Studio) -> None:
    page, scheme = studio.page, "document.documentElement.dataset.mantineColorScheme"
    studio.open("View")
    page.type("Look-ahead, ms", "200")
    page.tick("Contacts")
    page.click("Light theme")
    page.wait_for(f"{scheme} === 'light'", PATIENCE_S)
    studio.until(lambda message: message.look_ahead == pytest.approx(0.2))
    page.type("New preset", "day", enter=False)
    studio.says("200 ms look-ahead")
    page.click("Save preset")
    page.wait_for(NAMED % "day", PATIENCE_S)
    page.click("Dark theme", PATIENCE_S)
    page.tick("Contacts")
    page.type("Look-ahead, ms", "300")
    studio.server.ask({"op": "select_object", "actor": "actor", "body": "Box", "object": "torus"})
    studio.until(lambda message: message.look_ahead == pytest.approx(0.3))
    page.call("Page.reload")
    studio.wait_until_it_stands()
    studio.open("View")
    page.wait_for(NAMED % "day", PATIENCE_S)  # this browser has kept it
    page.click("Use this preset")
    studio.until(lambda message: message.look_ahead == pytest.approx(0.2) and studio.box()["object"] == "cube")
    page.wait_for(f"{scheme} === 'light'", PATIENCE_S)
    page.wait_for(CONTACTS, PATIENCE_S)
    page.click("Delete this preset")
    page.wait_for(NAMED % "none", PATIENCE_S)
    page.tick("Contacts")
    page.click("Dark theme")


def test_a_tablet_shows_stage_and_controls_side_by_side(studio: Studio) -> None:
    page = studio.page
    page.call("Emulation.setDeviceMetricsOverride", width=768, height=1024, deviceScaleFactor=1, mobile=True)
    page.call("Page.reload")
    studio.wait_until_it_stands()
    page.wait_for(f"({STAGE})[0] > 0 && innerWidth === 768", PATIENCE_S)
    width = page.wait_for("parseFloat(getComputedStyle(document.documentElement).getPropertyValue('--mn-width'))")
    assert width > 350
    assert page.evaluate("document.documentElement.scrollWidth") == 768
    studio.open("Takes")
    page.wait_for(f"{TEXT}.includes('Record makes')", PATIENCE_S)
    tops = {name: top for name, top in page.evaluate(TABS) if name in CONTROLS}
    assert tops.keys() == set(CONTROLS)
    assert len(set(tops.values())) == 1, f"the tabs wrap: {tops}"
    assert page.evaluate(WIDE_TABS) == 0
    page.call("Emulation.setDeviceMetricsOverride", width=1000, height=700, deviceScaleFactor=1, mobile=False)
    page.call("Page.reload")
    studio.wait_until_it_stands()
