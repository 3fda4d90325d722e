"""A look back at tracked bodies that were held still, so that nobody has to wait: hold still first, then ask."""

from collections.abc import Sequence

from manipnet.actors.actor import Actor
from manipnet.actors.calibration import Steady, steady_pose
from manipnet.actors.transitions import HOLD_AFTER_S
from manipnet.control.actors_proxy import ActorsProxy
from manipnet.geometry import Array


class SteadyBodies:
    """The bodies of an actor in the last `seconds` before `now_s`."""

    def __init__(self, actors_proxy: ActorsProxy, actor: Actor, now_s: float, seconds: float) -> None:
        self._proxy, self._actor, self._now_s, self._seconds = actors_proxy, actor, now_s, seconds

    def measure(self, roles: Sequence[str]) -> dict[str, Steady]:
        """The mean pose of the body behind each role. Raises `CalibrationError` and `RequestError`."""
        seen = self._proxy.ask(lambda: [self._recent(role) for role in roles])
        return {
            role: steady_pose(poses, role, rate_hz * self._seconds)
            for role, (poses, rate_hz) in zip(roles, seen, strict=True)
        }

    def _recent(self, role: str) -> tuple[Array, float]:
        health = self._actor.health(self._now_s)[role]
        if health.age_s > HOLD_AFTER_S:
            raise ValueError(
                f"{role} is not tracked at present; check it in the tracking software (`manipnet doctor` shows what "
                "arrives)"
            )
        return self._actor.body_poses(role, self._seconds), health.rate_hz
