"""What every receiver's test needs: a sink that can be waited on, and counters."""

import queue

import pytest

from manipnet.streams.bodies import BodyFrame
from manipnet.telemetry import Counters

PATIENCE_S = 20.0


class Heard:
    """A sink; `next()` waits for the next frame and fails the test when none comes."""

    def __init__(self) -> None:
        self.frames: queue.Queue[BodyFrame] = queue.Queue()

    def __call__(self, frame: BodyFrame) -> None:
        self.frames.put(frame)

    def next(self) -> BodyFrame:
        return self.frames.get(timeout=PATIENCE_S)


@pytest.fixture
def heard():
    return Heard()


@pytest.fixture
def counters():
    return Counters()
