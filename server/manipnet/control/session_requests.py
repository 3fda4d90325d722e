"""The requests about a running server. Handlers run on the control thread and reach the actors through the mailbox."""

import base64
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from manipnet import __version__
from manipnet.actors.actor import Actor
from manipnet.actors.props import Prop
from manipnet.common.file_names import is_encodable
from manipnet.config.settings import SCALE_RANGE
from manipnet.control.actors_proxy import ActorsProxy
from manipnet.control.request import (
    Handler,
    Request,
    RequestError,
    body_key,
    choice,
    flag,
    number,
    quoted,
)
from manipnet.geometry import Array
from manipnet.runtime.object_catalog import ObjectCatalog
from manipnet.runtime.status import status
from manipnet.synthesis.model.bundle import Bundle
from manipnet.synthesis.model.providers import MAX_LOOK_AHEAD_S
from manipnet.synthesis.model.shipped import NO_LICENCE
from manipnet.synthesis.objects.mesh import MeshError
from manipnet.synthesis.objects.units import UNITS_M
from manipnet.telemetry import Telemetry
from manipnet.tracking.tick import TICK_HZ
from manipnet.wire import VERSION
from manipnet.wire.hand_names import ANGLE_NAMES, JOINT_NAMES, OPENXR_JOINT_NAMES

MAX_PATH: Final = 1024


class SessionRequests:
    """Most operations of `docs/protocol.md`, Control."""

    def __init__(
        self,
        session: str,
        bundle: Bundle,
        solver: str,
        actors_proxy: ActorsProxy,
        catalog: ObjectCatalog,
        telemetry: Telemetry,
    ) -> None:
        self._session, self._bundle, self._solver = session, bundle, solver
        self._proxy, self._actors = actors_proxy, actors_proxy.actors
        self._catalog, self._telemetry = catalog, telemetry
        self._started_s = time.monotonic()
        self._initial = {actor.config.name: _carried(actor) for actor in self._actors}
        """What each body carried when the server started, as `objects` describes it."""

    def handlers(self) -> Mapping[str, Handler]:
        """One function per operation."""
        return {
            "hello": self._hello,
            "status": self._status,
            "objects": self._objects,
            "mesh": self._mesh,
            "select_object": self._select_object,
            "add_object": self._add_object,
            "look_ahead": self._look_ahead,
            "rest": self._rest,
            "pause": self._pause,
        }

    def _hello(self, _: Request) -> dict[str, Any]:
        return {
            "version": __version__,
            "schema": VERSION,
            "session": self._session,
            "model": self._bundle.name,
            "model_hash": self._bundle.model_hash,
            "licence": self._bundle.meta.get("licence", NO_LICENCE),
            "solver": self._solver,
            "tick_hz": TICK_HZ,
            "actors": [actor.config.name for actor in self._actors],
            "joint_names": list(JOINT_NAMES),
            "angle_names": list(ANGLE_NAMES),
            "openxr_joint_names": list(OPENXR_JOINT_NAMES),
            "objects": list(self._catalog.names()),
        }

    def _status(self, _: Request) -> dict[str, Any]:
        now_s = time.monotonic()
        report = self._proxy.ask(lambda: status(self._actors, self._telemetry, now_s))
        about = {"session": self._session, "uptime_s": now_s - self._started_s, "t": now_s}
        return {**about, "model": self._bundle.name, "solver": self._solver, **report}

    def _objects(self, _: Request) -> dict[str, Any]:
        return {
            "objects": list(self._catalog.names()),
            "bodies": self._proxy.ask(lambda: {actor.config.name: _carried(actor) for actor in self._actors}),
            "initial": self._initial,
            "problems": self._catalog.problems(),
        }

    def _mesh(self, request: Request) -> dict[str, Any]:
        actor = self._proxy.actor(request)
        props = {prop.name: prop for prop in self._proxy.ask(lambda: list(actor.props))}
        prop = props[choice(request, "body", tuple(props))]
        mesh = prop.shape.mesh
        return {
            "actor": actor.config.name,
            "body": prop.name,
            **_prop(prop),
            "vertices": base64.b64encode(mesh.vertices.astype("<f4").tobytes()).decode(),
            "faces": base64.b64encode(mesh.faces.astype("<u4").tobytes()).decode(),
        }

    def _select_object(self, request: Request) -> dict[str, Any]:
        actor = self._proxy.actor(request)
        body = body_key(request)
        name = choice(request, "object", self._catalog.names())
        scale = number(request, "scale", *SCALE_RANGE, default=1.0)
        try:
            shape = self._catalog.shape(name)  # may take a second, on this thread
        except MeshError as error:
            raise RequestError(str(error)) from None
        prop, seq = self._proxy.ask(lambda: (actor.carry(body, name, shape, scale), actor.seq))
        return {"actor": actor.config.name, "body": prop.name, **_prop(prop), "seq": seq}

    def _add_object(self, request: Request) -> dict[str, Any]:
        file = request.get("file")
        if not isinstance(file, str) or not 0 < len(file) <= MAX_PATH or "\0" in file:
            raise RequestError("file is missing or is not a path; give the path of a mesh on the server's machine")
        if not is_encodable(Path(file)):
            raise RequestError(
                f"file is {quoted(file)}, which this system cannot write in its encoding "
                f"({sys.getfilesystemencoding()}); use ASCII letters, or start the server with PYTHONUTF8=1"
            )
        try:
            shape = self._catalog.add(Path(file), choice(request, "unit", tuple(UNITS_M), default="m"))
        except MeshError as error:
            raise RequestError(str(error)) from None
        return {"object": shape.name}

    def _look_ahead(self, request: Request) -> dict[str, Any]:
        seconds = number(request, "seconds", 0.0, MAX_LOOK_AHEAD_S)

        def change() -> None:
            for actor in self._actors:
                actor.look_ahead_s = seconds

        self._proxy.ask(change)
        return {"seconds": seconds}

    def _rest(self, request: Request) -> dict[str, Any]:
        actors = self._proxy.named_or_all(request)
        self._proxy.ask(lambda: [actor.rest() for actor in actors])
        return {"actors": [actor.config.name for actor in actors]}

    def _pause(self, request: Request) -> dict[str, Any]:
        on = flag(request, "on", True)
        actors = self._proxy.named_or_all(request)
        self._proxy.ask(lambda: [actor.pause(on) for actor in actors])
        return {"actors": [actor.config.name for actor in actors], "paused": on}


def placement(offset: Array) -> dict[str, list[float]]:
    """An offset `(7,)` with the keys of a rig file."""
    return {"position": offset[:3].tolist(), "rotation": offset[3:].tolist()}


def _carried(actor: Actor) -> dict[str, dict[str, Any]]:
    """By prop, what an actor's bodies carry, at which size and place."""
    return {prop.name: _prop(prop) | placement(actor.offset(prop.name)) for prop in actor.props}


def _prop(prop: Prop) -> dict[str, Any]:
    return {"object": prop.object, "scale": prop.scale}
