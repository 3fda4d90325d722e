"""Receives frames as a server's actors do, without hands: so the doctor sees the same drops and states."""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from manipnet.actors.body_roles import BodyRoles
from manipnet.config.settings import WRISTS, ActorConfig, BodyKey
from manipnet.runtime.flight_recorder import FlightRecorder
from manipnet.runtime.frame_intake import FrameIntake
from manipnet.runtime.mailbox import Mailbox
from manipnet.runtime.status import bodies_report
from manipnet.runtime.tick_errors import TickErrors
from manipnet.telemetry import Telemetry
from manipnet.tracking.timeline import Timeline
from manipnet.wire.bodies import BodyFrame, BodySample

POLL_S = 0.02


class Rehearsal:
    """The actors of a rig, as far as their bodies go. One thread calls `run`, any thread `put`."""

    def __init__(self, actors: Sequence[ActorConfig], telemetry: Telemetry) -> None:
        self._actors = [_Actor(actor) for actor in actors]
        recorder, actors_as_such = FlightRecorder(Path(tempfile.gettempdir())), cast(Any, self._actors)
        self._intake = FrameIntake(actors_as_such, recorder, TickErrors((), recorder, telemetry), telemetry)
        self._mailbox = Mailbox(telemetry)
        self.put = self._mailbox.put
        """The sink of the receivers."""

    def work(self) -> None:
        """Take in what has arrived, after a short wait."""
        for frame in self._mailbox.wait(POLL_S):
            self._intake.push(frame)

    def report(self, now_s: float) -> dict[str, Any]:
        """What a server reports about its actors' bodies."""
        return {actor.config.name: {"bodies": actor.report(now_s)} for actor in self._actors}


class _Actor:
    """The part of an actor that takes frames."""

    def __init__(self, config: ActorConfig) -> None:
        self.config = config
        self._roles, self._timeline = BodyRoles(config), Timeline()

    def push(self, frame: BodyFrame, bodies: Mapping[BodyKey, BodySample]) -> str | None:
        poses = self._roles.poses(bodies)
        if not poses:
            return "unknown_body"
        return self._timeline.push(frame.t_s, poses, frame.t_received_s, frame.source)

    def expected(self) -> list[BodyKey]:
        return [body.key for body in self.config.bodies().values()]

    def report(self, now_s: float) -> dict[str, Any]:
        names = [*(wrist for wrist in WRISTS if wrist in self.config.wrists), *(p.name for p in self.config.objects)]
        return bodies_report(names, self._roles.keys(), self._timeline.health(now_s))
