"""Record the pictures of the live page: `python docs/record_page.py [NAME …]` rewrites `docs/images/NAME.webp`.

A real server plays its demo and records it. A headless Chromium then opens the recording on the page and steps through
it picture by picture, so that the result runs at the true speed although the browser draws in software. The pictures
`page-light` and `page-waiting` are instants of a live page, for which the computer should have nothing else to do. It
needs Chromium and the extra `dev`, and takes some minutes.
"""

import base64
import io
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).resolve().parent
sys.path.append(str(DOCS.parent / "tests" / "support"))

from browser import Page, browsing  # noqa: E402
from live_server import LiveServer, serving  # noqa: E402
from studio import DISMISS, PLACE, TEXT  # noqa: E402

TAKE = "demo"
PATIENCE_S = 240.0
DEMO_S = 42.5
SETTLE_S = 4.0
"""The camera reaches what it follows in this time."""
SHAPES = ("--mesh", "cylinder=bottle", "--mesh", "mug=wine_glass")


@dataclass(frozen=True)
class Clip:
    """A part of the demo, played by a server with some options, or an instant of it."""

    options: tuple[str, ...]
    performed_s: tuple[float, float]
    """Seconds after the start of the demo; the same twice for an instant."""
    window: tuple[int, int] = (880, 440)
    shown: tuple[int, int] = (440, 264)
    whole: bool = False
    """Whether the panel is in the picture, and the camera follows; otherwise it is the stage, and the camera stands."""
    rate_hz: float = 6.0


CLIPS = {
    "page": Clip((), (29.0, 36.0), (1000, 500), (1000, 500), whole=True),
    "take-cube": Clip((), (7.0, 7.0)),
    "take-cylinder": Clip((), (20.0, 20.0)),
    "take-bottle": Clip(SHAPES, (20.0, 20.0)),
    "take-glass": Clip(SHAPES, (34.5, 34.5)),
}


LIVE = ("page-light", "page-waiting")
LIVE_WINDOW = (1280, 800)


def main(names: list[str]) -> None:
    """Write the pictures with these names; without a name, all of them."""
    for name in [name for name in names or LIVE if name in LIVE]:
        write_live(name)
    names = [name for name in names or CLIPS if name not in LIVE]
    write_clips(names)


def write_live(name: str) -> None:
    """Write an instant of a live page: one that records in the light theme, or one that waits for bodies."""
    options = ("--demo",) if name == "page-light" else ("--mesh", "mug=mug")
    with (
        tempfile.TemporaryDirectory() as folder,
        serving(*options, "--takes", f"{folder}/takes") as server,
        browsing("chromium", server.addresses["page"], Path(folder) / "profile") as page,
    ):
        width, height = LIVE_WINDOW
        page.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        if name == "page-light":
            page.click("Light theme", PATIENCE_S)
            page.tick("Contacts")
            time.sleep(DEMO_S - 10.0)  # the charts forget the start
            page.click("Record")
            page.wait_for(f"{TEXT}.includes('REC 0:09') && {TEXT}.includes('● Live')", PATIENCE_S)
        else:
            page.wait_for(f"{TEXT}.includes('nothing arrives at all')", PATIENCE_S)
        page.evaluate(DISMISS)
        time.sleep(1.0)
        screenshot(page).save(DOCS / "images" / f"{name}.webp", quality=78, method=6)


def write_clips(names: list[str]) -> None:
    """Record the demo, step through the recording, and write the pictures with these names."""
    takes = Path(tempfile.gettempdir()) / "takes"  # the page shows its name
    file = takes / f"{TAKE}.mcap"
    for options, group in groupby(names, key=lambda name: CLIPS[name].options):
        file.unlink(missing_ok=True)
        with serving("--demo", *options, "--takes", str(takes)) as server:
            record(server)
        with (
            serving("--takes", str(takes)) as server,  # receives nothing, so the browser draws nothing but the take
            tempfile.TemporaryDirectory() as profile,
            browsing("chromium", server.addresses["page"], Path(profile)) as page,
        ):
            for name in group:
                write(name, list(pictures(page, CLIPS[name])))
        file.unlink()


def record(server: LiveServer) -> None:
    """Let the server record its demo once."""
    began_s = time.monotonic()
    assert server.ask({"op": "record", "name": TAKE})["name"]
    time.sleep(max(began_s + DEMO_S - time.monotonic(), 0.0))
    server.ask({"op": "stop_recording"})


def write(name: str, images: list[Image.Image]) -> None:
    """Write pictures as one that moves."""
    file, pause_ms = DOCS / "images" / f"{name}.webp", round(1e3 / CLIPS[name].rate_hz)
    images[0].save(file, save_all=True, append_images=images[1:], duration=pause_ms, loop=0, quality=78, method=6)
    print(f"wrote {file}: {len(images)} pictures, {file.stat().st_size / 1e6:.2f} MB", flush=True)


def pictures(page: Page, clip: Clip) -> Iterator[Image.Image]:
    """Open the recording with the health panel folded away, and step through the clip."""
    width, height = clip.window
    page.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
    page.call("Page.reload")
    page.wait_for(f"{TEXT}.includes('Waiting for bodies') && document.title === 'ManipNet Live'", PATIENCE_S)
    page.evaluate(DISMISS)
    page.press((290.0, 7.0))  # the arrow that folds the left panel
    page.click("Takes", PATIENCE_S)
    page.wait_for(f"[...document.querySelectorAll('input')].some(field => field.value === '{TAKE}.mcap')", PATIENCE_S)
    page.click("Show this take", PATIENCE_S)
    page.wait_for(f"{TEXT}.includes('Time, s')", PATIENCE_S)
    first_s, last_s = clip.performed_s
    show(page, first_s if clip.whole else 0.5 * (first_s + last_s), SETTLE_S)
    if not clip.whole:
        page.drag((300.0, 200.0), (300.0, 200.5))  # takes the camera
    page.evaluate(DISMISS)
    for k in range(max(round((last_s - first_s) * clip.rate_hz), 1)):
        show(page, first_s + k / clip.rate_hz, 0.7)  # the browser draws once or twice in this time
        yield picture(page, clip)


def show(page: Page, second: float, wait_s: float) -> None:
    """Show an instant of the recording."""
    page.type("Time, s", f"{second:.2f}")
    time.sleep(wait_s)
    page.evaluate("document.activeElement.blur()")


def picture(page: Page, clip: Clip) -> Image.Image:
    """What the page looks like."""
    image = screenshot(page)
    if not clip.whole:
        left, top, width, _ = page.evaluate(PLACE)
        high = width * clip.shown[1] / clip.shown[0]  # what is below shows only the table
        image = image.crop((round(left), round(top), round(left + width), round(top + high)))
    return image.resize(clip.shown, Image.Resampling.LANCZOS)


def screenshot(page: Page) -> Image.Image:
    """The whole window."""
    content = base64.b64decode(page.call("Page.captureScreenshot")["data"])
    return Image.open(io.BytesIO(content)).convert("RGB")


if __name__ == "__main__":
    main(sys.argv[1:])
