"""Where receivers leave frames, and other threads requests, for the one thread that ticks."""

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Final, TypeVar

from manipnet.telemetry import Telemetry
from manipnet.wire.bodies import BodyFrame

MAX_FRAMES: Final = 512
"""More than a second at 360 Hz; beyond it the oldest frames make room."""
MAX_REQUESTS: Final = 16

T = TypeVar("T")


class BusyError(RuntimeError):
    """The tick thread has not answered in time, or has too much to answer."""


class Mailbox:
    """Bounded, newest wins. `put` and `ask` from any thread; `wait` from the tick thread only."""

    def __init__(self, telemetry: Telemetry) -> None:
        self._telemetry = telemetry
        self._news = threading.Condition()
        self._frames: deque[BodyFrame] = deque()
        self._requests: deque[tuple[Callable[[], object], Future]] = deque()

    def put(self, frame: BodyFrame) -> None:
        """Leave a frame; never waits for the tick thread."""
        with self._news:
            if len(self._frames) >= MAX_FRAMES:
                self._frames.popleft()
                self._telemetry.count("frames_dropped", reason="mailbox_full")
            self._frames.append(frame)
            self._news.notify()

    def ask(self, question: Callable[[], T], timeout_s: float = 1.0) -> T:
        """Run `question` on the tick thread, between two ticks, and return its answer or raise its error.

        Raises `BusyError` when there is none in time.
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

    def wait(self, timeout_s: float) -> list[BodyFrame]:
        """All frames left so far; waits for the first news at most `timeout_s`. Answers requests on the way."""
        with self._news:
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
    except Exception as error:  # whoever asked gets it; the ticks go on
        answer.set_exception(error)
