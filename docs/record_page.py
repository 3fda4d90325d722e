"""Record the moving picture of the live page: `python docs/record_page.py` rewrites `docs/images/page.webp`.

A real server plays its demo and records part of it. A headless Chromium then opens the recording on the page and steps
through it picture by picture, so that the result runs at the true speed although the browser draws in software. It
needs Chromium and Pillow, and takes about five minutes.
"""

import base64
import io
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

DOCS = Path(__file__).resolve().parent
sys.path.append(str(DOCS.parent / "tests" / "support"))

from browser import Page, browsing  # noqa: E402
from live_server import LiveServer, serving  # noqa: E402

TAKE = "mug"
PERFORMED_S = (27.5, 40.0)
"""The part of the demo to show, in seconds after its start; it ends nearly as it begins."""
RATE_HZ = 12.0
WINDOW = (1200, 600)
SHOWN = (960, 480)
ZOOM_STEPS, DOWN_PX = 2, 125
"""How far the camera goes in, and the scene down, from where the page puts them."""
PATIENCE_S = 240.0
TEXT = "document.body.innerText"
DISMISS = "document.querySelectorAll('.mantine-Notification-closeButton').forEach(button => button.click())"


def main() -> None:
    """Record, step through the recording, and write the picture."""
    takes = Path(tempfile.gettempdir()) / "takes"  # the page shows its name
    with tempfile.TemporaryDirectory() as profile, serving("--demo", "--takes", str(takes)) as server:
        seconds = record(server)
        with browsing("chromium", server.addresses["page"], Path(profile)) as page:
            set_up(page)
            pictures = [picture(page, k / RATE_HZ) for k in range(1, int(seconds * RATE_HZ))]  # it opened at 0
    (takes / f"{TAKE}.mcap").unlink()
    file = DOCS / "images" / "page.webp"
    pictures[0].save(
        file, save_all=True, append_images=pictures[1:], duration=round(1e3 / RATE_HZ), loop=0, quality=80, method=6
    )
    print(f"wrote {file}: {len(pictures)} pictures, {file.stat().st_size / 1e6:.1f} MB")


def record(server: LiveServer) -> float:
    """Let the server record the part of its demo; the length in seconds."""
    began_s = time.monotonic()
    answer = {}
    for at_s, request in zip(PERFORMED_S, ({"op": "record", "name": TAKE}, {"op": "stop_recording"}), strict=True):
        time.sleep(max(began_s + at_s - time.monotonic(), 0.0))
        answer = server.ask(request)
    return float(answer["seconds"])


def set_up(page: Page) -> None:
    """Open the recording on the page, with the health panel folded away and the camera a little nearer."""
    width, height = WINDOW
    page.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
    page.wait_for(f"{TEXT}.includes('hands/s') && document.title === 'ManipNet Live'", PATIENCE_S)
    page.evaluate(DISMISS)
    page.press((290.0, 7.0))  # the arrow that folds the left panel
    page.click("Takes", PATIENCE_S)
    page.wait_for(f"[...document.querySelectorAll('input')].some(field => field.value === '{TAKE}.mcap')", PATIENCE_S)
    page.click("Show this take", PATIENCE_S)
    page.wait_for(f"{TEXT}.includes('Time, s')", PATIENCE_S)
    x, y = 420.0, 250.0
    for _ in range(ZOOM_STEPS):
        page.call("Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y, deltaX=0, deltaY=-100)
        time.sleep(1.0)
    drag(page, (x, y), (x, y + DOWN_PX))


def drag(page: Page, start: tuple[float, float], end: tuple[float, float]) -> None:
    """Drag with the right button, which moves the camera sideways."""
    for kind, (x, y) in (("mousePressed", start), ("mouseMoved", end), ("mouseReleased", end)):
        page.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="right", buttons=2, clickCount=1)
        time.sleep(0.5)


def picture(page: Page, second: float) -> Image.Image:
    """What the page looks like at an instant of the recording."""
    page.type("Time, s", f"{second:.2f}")
    time.sleep(0.7)  # the browser draws once or twice in this time
    page.evaluate("document.activeElement.blur()")
    screenshot = base64.b64decode(page.call("Page.captureScreenshot")["data"])
    return Image.open(io.BytesIO(screenshot)).convert("RGB").resize(SHOWN, Image.Resampling.LANCZOS)


if __name__ == "__main__":
    main()
