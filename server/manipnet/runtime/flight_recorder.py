"""The last moments before an internal error, in a file: what came in, and what was about to be computed."""

import json
import logging
import threading
import time
import traceback
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from manipnet.common.atomic_file import replacing
from manipnet.tracking.tick import Tick
from manipnet.wire.bodies import BodyFrame

KEEP_FRAMES: Final = 360
"""One to three seconds of input."""
EVERY_S: Final = 60.0
MAX_DUMPS: Final = 10
"""Files of one session: an error that repeats 60 times a second must not fill the disk."""

_log = logging.getLogger(__name__)


class FlightRecorder:
    """Keeps the newest frames and writes them out after an error.

    Belongs to the tick thread, which never waits for the disk.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._frames = deque[BodyFrame](maxlen=KEEP_FRAMES)
        self._last_s, self._count = float("-inf"), 0
        self._writing: threading.Thread | None = None

    def note(self, frame: BodyFrame) -> None:
        """Remember a frame."""
        self._frames.append(frame)

    def dump(self, error: BaseException, ticks: Sequence[Tick], now_s: float) -> Path | None:
        """Let a thread write the frames, the ticks and the error as JSON. The end of the program waits for the thread.

        Returns the file's path, or None if a file was written less than `EVERY_S` ago or `MAX_DUMPS` are written.
        """
        if now_s - self._last_s < EVERY_S or self._count >= MAX_DUMPS:
            return None
        self._last_s, self._count = now_s, self._count + 1
        path = self._folder / f"manipnet-{time.strftime('%Y%m%d-%H%M%S')}-{self._count}.json"
        lines = traceback.format_exception(error)
        self._writing = threading.Thread(
            target=_write, args=(path, lines, tuple(ticks), tuple(self._frames)), name="flight-recorder"
        )
        self._writing.start()
        return path

    def finish(self) -> None:
        """Wait until the newest file is written."""
        if self._writing is not None:
            self._writing.join()


def _write(path: Path, error: Sequence[str], ticks: Sequence[Tick], frames: Sequence[BodyFrame]) -> None:
    content = {"error": error, "ticks": [_tick(tick) for tick in ticks], "frames": [_frame(frame) for frame in frames]}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as file:
            file.write(json.dumps(content).encode("utf-8"))
    except OSError as problem:
        _log.error("the frames before an error cannot be written to %s: %s", path.parent, problem)


def _frame(frame: BodyFrame) -> dict[str, Any]:
    return {**frame._asdict(), "bodies": [body._asdict() for body in frame.bodies]}


def _tick(tick: Tick) -> dict[str, Any]:
    bodies = {name: {"pose": body.pose.tolist(), "age_s": body.age_s} for name, body in tick.bodies.items()}
    return {"run": tick.run, "index": tick.index, "time_s": tick.time_s, "silent": tick.silent, "bodies": bodies}
