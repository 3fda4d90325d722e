"""Where receivers leave frames, and other threads their requests, for the thread that ticks."""

import math
import threading
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import Final, TypeVar

from manipnet.telemetry import Telemetry
from manipnet.wire.bodies import BodyFrame

MAX_FRAMES: Final = 512
"""More than a second at 360 Hz. If more frames wait, the oldest are dropped."""
MAX_REQUESTS: Final = 16

T = TypeVar("T")


class BusyError(RuntimeError):
    """The tick thread did not answer in time, or too many requests wait for it."""


class Mailbox:
    """A bounded queue that keeps the newest frames. Only the tick thread calls `wait`; any thread calls the others."""

    def __init__(self, telemetry: Telemetry) -> None:
        self._telemetry = telemetry
        self._news = threading.Condition()
        self._frames: deque[BodyFrame] = deque()
        self._requests: deque[tuple[Callable[[], object], Future]] = deque()
        self._awaited: Mapping[str, float] = {}

    def put(self, frame: BodyFrame) -> None:
        """Leave a frame, without waiting for the tick thread."""
        with self._news:
            if len(self._frames) >= MAX_FRAMES:
                self._frames.popleft()
                self._telemetry.count("frames_dropped", reason="mailbox_full")
            self._frames.append(frame)
            if frame.t_s >= self._awaited.get(frame.source, -math.inf):
                self._news.notify()

    def ask(self, question: Callable[[], T], timeout_s: float = 1.0) -> T:
        """Run `question` on the tick thread between two ticks; returns its answer or raises its error.

        Raises `BusyError` if there is no answer in time.
        """
        answer: Future = Future()
        with self._news:
            if len(self._requests) >= MAX_REQUESTS:
                raise BusyError("the server has too many requests waiting; ask again later")
            self._requests.append((question, answer))
            self._news.notify()
        try:
            return answer.result(timeout_s)
        except TimeoutError:
            answer.cancel()
            raise BusyError(f"the server did not answer within {timeout_s} s") from None

    def wait(self, timeout_s: float, awaited: Mapping[str, float] | None = None) -> list[BodyFrame]:
        """Take all frames, after a wait of at most `timeout_s` for something to arrive; answers the requests too.

        A sender's frames from before the time `awaited` of it do not end the wait, because each end of it costs as much
        as taking two frames in. Frames of other senders do.
        """
        with self._news:
            self._awaited = awaited or {}
            if not (self._frames or self._requests) and timeout_s > 0.0:
                self._news.wait(timeout_s)
            frames, requests = list(self._frames), list(self._requests)
            self._frames.clear()
            self._requests.clear()
        for question, answer in requests:
            if answer.set_running_or_notify_cancel():
                _answer(question, answer)
        return frames


def _answer(question: Callable[[], object], answer: Future) -> None:
    try:
        answer.set_result(question())
    except Exception as error:  # the caller of `ask` receives it, and the ticks go on
        answer.set_exception(error)
