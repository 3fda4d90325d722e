"""Requests about where things sit on their bodies: `calibrate` and `place_object`, in force at once, kept in the rig
file. They look back at what was tracked, so nobody waits: hold still first, ask then."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from manipnet.actors import calibration
from manipnet.actors.actor import Actor
from manipnet.actors.calibration import CalibrationError, Steady, steady_pose
from manipnet.actors.transitions import HOLD_AFTER_S
from manipnet.common.options import ConfigError
from manipnet.config.rig_writer import store
from manipnet.config.settings import WRISTS
from manipnet.control.actors_proxy import ActorsProxy, body_key
from manipnet.control.request import Handler, Request, RequestError, choice, number
from manipnet.control.session_requests import placement
from manipnet.geometry import Array, compose, invert, quat_normalize
from manipnet.wire import SIDES, Side

SECONDS: Final = 2.0
SECONDS_RANGE: Final = (0.5, 4.0)
STEPS: Final = ("wrists", "fingertips")
NOT_STORED: Final = "the server was started without --rig FILE: this lasts until it stops"


class CalibrationRequests:
    """The operations of `docs/calibration.md`."""

    def __init__(
        self, actors_proxy: ActorsProxy, rig: Path | None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """`rig` is the file the actors came from, if any; `clock` is the receivers'."""
        self._proxy, self._rig, self._clock = actors_proxy, rig, clock
        self._backed_up = False

    def handlers(self) -> dict[str, Handler]:
        """One function per operation."""
        return {"calibrate": self._calibrate, "place_object": self._place_object}

    def _calibrate(self, request: Request) -> dict[str, Any]:
        actor = self._proxy.actor(request)
        step = choice(request, "step", STEPS, default=STEPS[0])
        sides: list[Side] = [side for side in SIDES if side in actor.hands]
        wanted = choice(request, "hand", ("both", *sides), default="both")
        sides = [side for side in sides if wanted in ("both", side)]
        reference = None if request.get("reference") is None else self._reference(actor, request)
        scale = self._typed_scale(request, actor)
        look = Look(self._proxy, actor, self._clock(), number(request, "seconds", *SECONDS_RANGE, default=SECONDS))
        try:
            shown = look.at([*(f"{side}_wrist" for side in sides), *([reference] if reference else [])])
            sheet = self._sheet(request, actor, reference, shown)
            if step == "wrists":
                offsets = {
                    f"{side}_wrist": calibration.calibrate_wrist(side, shown[f"{side}_wrist"], sheet, scale)
                    for side in sides
                }
            else:
                scale, offsets = self._touched(actor, sides, shown, sheet)
        except CalibrationError as error:
            raise RequestError(str(error)) from None
        before = self._put(actor, offsets, scale)
        steady = {part: shown[part] for part in offsets if part in shown}
        return {
            "actor": actor.config.name,
            "quality": "good" if all(one.good for one in steady.values()) else "fair",
            "hand_scale": scale,
            "hands": {part: _found(one, offsets[part], before[part]) for part, one in steady.items()},
            **self._keep(actor, request),
        }

    def _touched(
        self, actor: Actor, sides: Sequence[Side], shown: dict[str, Steady], sheet: Array
    ) -> tuple[float, dict[str, Array]]:
        """Size of the hands whose fingertips touch the sheet's centre line, and the offsets it changes."""
        lengths = []
        for side in sides:
            cluster = shown[f"{side}_wrist"]
            wrist = compose(cluster.pose, actor.offset(f"{side}_wrist"))
            lengths.append(calibration.measured_length(side, wrist, sheet))
        scale = _scale_of(float(np.mean(lengths)))
        before = actor.config.hand_scale
        parts = [part for part in WRISTS if part in actor.config.wrists]
        return scale, {part: calibration.scaled_offset(actor.offset(part), before, scale) for part in parts}

    def _typed_scale(self, request: Request, actor: Actor) -> float:
        if request.get("hand_length") is None:
            return actor.config.hand_scale
        return _scale_of(number(request, "hand_length", *calibration.HAND_LENGTH_RANGE_M))

    def _reference(self, actor: Actor, request: Request) -> str:
        names = tuple(prop.name for prop in actor.props)
        return choice(request, "reference", names)

    def _sheet(self, request: Request, actor: Actor, reference: str | None, shown: dict[str, Steady]) -> Array:
        """Where the sheet lies: said, under a prop, or else at the world's origin."""
        if reference is not None:
            prop = next(prop for prop in actor.props if prop.name == reference)
            T_world_object = compose(shown[reference].pose, actor.offset(reference))
            lowest_m = calibration.lowest_point(prop.shape.mesh.vertices * prop.scale, T_world_object)
            return calibration.sheet_under(T_world_object, lowest_m)
        x, y, z, yaw = _numbers(request, "sheet", 4, (0.0, 0.0, 0.0, 0.0))
        return calibration.sheet_at(np.array([x, y, z]), yaw)

    def _place_object(self, request: Request) -> dict[str, Any]:
        actor = self._proxy.actor(request)
        body = body_key(request)
        part = self._proxy.ask(lambda: actor.role(body))
        props = {prop.name: prop for prop in actor.props}
        if part not in props:
            allowed = ", ".join(props) or "none: select_object gives a body something to carry"
            raise RequestError(f"body {body!r} carries nothing that could be placed; allowed are {allowed}")
        if _flag(request, "on_sheet", False):
            offset = self._on_sheet(request, actor, part, props[part].shape.bounds[0, 1] * props[part].scale)
        else:
            offset = np.concatenate([_numbers(request, "position", 3, (0.0, 0.0, 0.0)), _rotation(request)])
        self._put(actor, {part: offset}, actor.config.hand_scale)
        return {"actor": actor.config.name, "body": part, **placement(offset), **self._keep(actor, request)}

    def _on_sheet(self, request: Request, actor: Actor, part: str, lowest_m: float) -> Array:
        """Where an object sits on its body that stands upright in the middle of the sheet."""
        look = Look(self._proxy, actor, self._clock(), number(request, "seconds", *SECONDS_RANGE, default=SECONDS))
        try:
            body = look.at([part])[part]
        except CalibrationError as error:
            raise RequestError(str(error)) from None
        sheet = self._sheet(request, actor, None, {})
        return compose(invert(body.pose), calibration.upright_on_sheet(sheet, lowest_m))

    def _put(self, actor: Actor, offsets: dict[str, Array], scale: float) -> dict[str, Array]:
        """Everything of one calibration between the same two ticks; returns the offsets there were."""

        def put() -> dict[str, Array]:
            before = {part: actor.offset(part) for part in offsets}
            for part, offset in offsets.items():
                actor.place(part, offset)
            actor.resize_hands(scale)
            return before

        return self._proxy.ask(put)

    def _keep(self, actor: Actor, request: Request) -> dict[str, Any]:
        """Write the rig file; what came of it, for the answer."""
        if not _flag(request, "store", True):
            return {"stored": None, "note": "as asked, the rig file stays as it is"}
        if self._rig is None:
            return {"stored": None, "note": NOT_STORED}
        try:
            store(self._rig, actor.config, backup=not self._backed_up)
        except ConfigError as error:
            return {"stored": None, "note": f"in force, but not stored: {error}"}
        self._backed_up = True
        return {"stored": str(self._rig), "note": f"what was there before is in {self._rig.name}.bak"}


class Look:
    """A look back at what was tracked of an actor."""

    def __init__(self, actors_proxy: ActorsProxy, actor: Actor, now_s: float, seconds: float) -> None:
        self._proxy, self._actor, self._now_s, self._seconds = actors_proxy, actor, now_s, seconds

    def at(self, parts: Sequence[str]) -> dict[str, Steady]:
        """Each part's body as it was held still. Raises `CalibrationError` and `RequestError`."""
        seen = self._proxy.ask(lambda: [self._of(part) for part in parts])
        return {
            part: steady_pose(poses, part, rate_hz * self._seconds)
            for part, (poses, rate_hz) in zip(parts, seen, strict=True)
        }

    def _of(self, part: str) -> tuple[Array, float]:
        health = self._actor.health(self._now_s)[part]
        if health.age_s > HOLD_AFTER_S:
            raise ValueError(f"{part} is not tracked at present; see it in the tracking software (`manipnet doctor`)")
        return self._actor.body_poses(part, self._seconds), health.rate_hz


def _scale_of(length_m: float) -> float:
    return length_m / calibration.HAND_LENGTH_M


def _found(steady: Steady, offset: Array, before: Array) -> dict[str, Any]:
    changed_m, changed_rad = calibration.difference(before, offset)
    return {
        **placement(offset),
        "spread_mm": 1e3 * steady.spread_m,
        "spread_deg": float(np.degrees(steady.spread_rad)),
        "drift_mm": 1e3 * steady.drift_m,
        "drift_deg": float(np.degrees(steady.drift_rad)),
        "changed_mm": 1e3 * changed_m,
        "changed_deg": float(np.degrees(changed_rad)),
        "samples": steady.samples,
        "outliers": steady.outliers,
    }


def _flag(request: Request, key: str, default: bool) -> bool:
    value = request.get(key, default)
    if not isinstance(value, bool):
        raise RequestError(f"{key} is {str(value)[:60]}; it must be true or false")
    return value


def _numbers(request: Request, key: str, count: int, default: Sequence[float]) -> Array:
    values = request.get(key, default)
    if not isinstance(values, list | tuple) or len(values) != count:
        raise RequestError(f"{key} is {str(values)[:60]}; it must be {count} numbers")
    return np.array([number({key: value}, key, -100.0, 100.0) for value in values])


def _rotation(request: Request) -> Array:
    rotation = _numbers(request, "rotation", 4, (0.0, 0.0, 0.0, 1.0))
    try:
        return quat_normalize(rotation)
    except ValueError:
        raise RequestError("rotation is zero; it must be a quaternion x, y, z, w") from None
