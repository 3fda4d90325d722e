"""The requests `calibrate` and `place_object`, which change where wrists and props sit on their bodies.

The result is in force at once and is stored in the rig file.
"""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from manipnet.actors import calibration
from manipnet.actors.actor import Actor
from manipnet.actors.calibration import CalibrationError, Steady
from manipnet.common.options import ConfigError
from manipnet.config.rig_writer import store
from manipnet.config.settings import WRISTS
from manipnet.control.actors_proxy import ActorsProxy
from manipnet.control.request import Handler, Request, RequestError, body_key, choice, flag, number, numbers
from manipnet.control.session_requests import placement
from manipnet.control.steady_bodies import SteadyBodies
from manipnet.geometry import Array, compose, invert, quat_normalize
from manipnet.wire import SIDES, Side

SECONDS: Final = 2.0
SECONDS_RANGE: Final = (0.5, 4.0)
STEPS: Final = ("wrists", "fingertips")


class CalibrationRequests:
    """The operations of `docs/calibration.md`."""

    def __init__(
        self, actors_proxy: ActorsProxy, rig: Path | None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """`rig` is the file from which the actors came, if any; `clock` is the receivers' clock."""
        self._proxy, self._rig, self._clock = actors_proxy, rig, clock
        self._backed_up = False

    def handlers(self) -> dict[str, Handler]:
        """One function per operation."""
        return {"calibrate": self._calibrate, "place_object": self._place_object}

    def _calibrate(self, request: Request) -> dict[str, Any]:
        actor = self._proxy.actor(request)
        step = choice(request, "step", STEPS, default=STEPS[0])
        sides = _sides(request, actor)
        props = tuple(prop.name for prop in actor.props)
        reference = None if request.get("reference") is None else choice(request, "reference", props)
        scale = _requested_scale(request, actor)
        bodies = self._steady_bodies(request, actor)
        try:
            seen = bodies.measure([*(f"{side}_wrist" for side in sides), *([reference] if reference else [])])
            sheet = _sheet(request, actor, reference, seen)
            if step == "wrists":
                wrists: dict[str, Side] = {f"{side}_wrist": side for side in sides}
                offsets = {
                    role: calibration.calibrate_wrist(side, seen[role], sheet, scale) for role, side in wrists.items()
                }
            else:
                scale, offsets = _touched(actor, sides, seen, sheet)
        except CalibrationError as error:
            raise RequestError(str(error)) from None
        before = self._apply(actor, offsets, scale)
        measured = {role: seen[role] for role in offsets if role in seen}
        return {
            "actor": actor.config.name,
            "quality": "good" if all(steady.good for steady in measured.values()) else "fair",
            "hand_scale": scale,
            "hands": {role: _report(steady, offsets[role], before[role]) for role, steady in measured.items()},
            **self._store(actor, request),
        }

    def _place_object(self, request: Request) -> dict[str, Any]:
        actor = self._proxy.actor(request)
        body = body_key(request)
        role = self._proxy.ask(lambda: actor.role(body))
        props = {prop.name: prop for prop in actor.props}
        if role not in props:
            allowed = ", ".join(props) or "none yet: select_object lets a body carry one"
            raise RequestError(f"body {body!r} does not carry an object; allowed are {allowed}")
        if flag(request, "on_sheet", False):
            offset = self._on_sheet(request, actor, role, props[role].shape.bounds[0, 1] * props[role].scale)
        else:
            offset = np.concatenate([numbers(request, "position", (0.0, 0.0, 0.0)), _rotation(request)])
        self._apply(actor, {role: offset}, actor.config.hand_scale)
        return {"actor": actor.config.name, "body": role, **placement(offset), **self._store(actor, request)}

    def _steady_bodies(self, request: Request, actor: Actor) -> SteadyBodies:
        seconds = number(request, "seconds", *SECONDS_RANGE, default=SECONDS)
        return SteadyBodies(self._proxy, actor, self._clock(), seconds)

    def _on_sheet(self, request: Request, actor: Actor, role: str, lowest_y_m: float) -> Array:
        """The offset of an object that stands upright in the middle of the sheet; its mesh reaches to `lowest_y_m`."""
        try:
            body = self._steady_bodies(request, actor).measure([role])[role]
        except CalibrationError as error:
            raise RequestError(str(error)) from None
        sheet = _sheet(request, actor, None, {})
        return compose(invert(body.pose), calibration.upright_on_sheet(sheet, lowest_y_m))

    def _apply(self, actor: Actor, offsets: dict[str, Array], scale: float) -> dict[str, Array]:
        """Change everything of one calibration between the same two ticks; returns the offsets from before."""

        def apply() -> dict[str, Array]:
            before = {role: actor.offset(role) for role in offsets}
            for role, offset in offsets.items():
                actor.place(role, offset)
            actor.resize_hands(scale)
            return before

        return self._proxy.ask(apply)

    def _store(self, actor: Actor, request: Request) -> dict[str, Any]:
        """Write the rig file; returns the part of the answer that says whether it was written."""
        if not flag(request, "store", True):
            return {"stored": None, "note": "the rig file was not changed, as requested"}
        if self._rig is None:
            return {
                "stored": None,
                "note": "in force until the server stops: it was started without --rig FILE",
            }
        try:
            store(self._rig, actor.config, backup=not self._backed_up)
        except ConfigError as error:
            return {"stored": None, "note": f"in force, but not stored: {error}"}
        self._backed_up = True
        return {"stored": str(self._rig), "note": f"the file from before is kept as {self._rig.name}.bak"}


def _sides(request: Request, actor: Actor) -> list[Side]:
    sides: list[Side] = [side for side in SIDES if side in actor.hands]
    hand = choice(request, "hand", ("both", *sides), default="both")
    return [side for side in sides if hand in ("both", side)]


def _requested_scale(request: Request, actor: Actor) -> float:
    if request.get("hand_length") is None:
        return actor.config.hand_scale
    return _scale(number(request, "hand_length", *calibration.HAND_LENGTH_RANGE_M))


def _sheet(request: Request, actor: Actor, reference: str | None, seen: dict[str, Steady]) -> Array:
    """`T_world_sheet (7,)`: under the `reference` prop, or where the request says, by default at the world's origin."""
    if reference is not None:
        prop = next(prop for prop in actor.props if prop.name == reference)
        T_world_object = compose(seen[reference].pose, actor.offset(reference))
        lowest_m = calibration.lowest_point(prop.shape.mesh.vertices * prop.scale, T_world_object)
        return calibration.sheet_under(T_world_object, lowest_m)
    x, y, z, yaw = numbers(request, "sheet", (0.0, 0.0, 0.0, 0.0))
    return calibration.sheet_at(np.array([x, y, z]), yaw)


def _touched(
    actor: Actor, sides: Sequence[Side], seen: dict[str, Steady], sheet: Array
) -> tuple[float, dict[str, Array]]:
    """The scale of hands whose fingertips touch the centre line of the sheet, and the wrist offsets that it changes."""
    lengths_m = []
    for side in sides:
        wrist = compose(seen[f"{side}_wrist"].pose, actor.offset(f"{side}_wrist"))
        lengths_m.append(calibration.measured_length(side, wrist, sheet))
    scale, before = _scale(float(np.mean(lengths_m))), actor.config.hand_scale
    wrists = [role for role in WRISTS if role in actor.config.wrists]
    return scale, {role: calibration.scaled_offset(actor.offset(role), before, scale) for role in wrists}


def _scale(length_m: float) -> float:
    return length_m / calibration.HAND_LENGTH_M


def _rotation(request: Request) -> Array:
    rotation = numbers(request, "rotation", (0.0, 0.0, 0.0, 1.0))
    try:
        return quat_normalize(rotation)
    except ValueError:
        raise RequestError("rotation is zero; it must be a quaternion x, y, z, w") from None


def _report(steady: Steady, offset: Array, before: Array) -> dict[str, Any]:
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
