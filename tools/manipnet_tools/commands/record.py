"""`manipnet record`: writes the bodies and hands of a running server, or the bodies that a tracker sends."""

import base64
import json
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
import zmq
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from manipnet.common.options import Endpoint
from manipnet.config.rig_reader import load_rig
from manipnet.control.client import ControlClient
from manipnet.inputs.zeromq import ZEROMQ
from manipnet.inputs.zeromq.receiver import ZmqBodies
from manipnet.net.curve_keys import read_client_keys
from manipnet.net.zmq_socket import connect, tcp_address
from manipnet.recording.mcap_file import BODIES, HANDS, RecordingError, RecordingWriter, bodies_of, mesh_file
from manipnet.runtime.signals import stop_on_signals
from manipnet.synthesis.objects.mesh import load_mesh
from manipnet.telemetry import Telemetry
from manipnet.wire import TOPIC_MSGPACK, HandsMessage, decode_msgpack
from manipnet.wire.bodies import BodyFrame, MessageError
from manipnet_tools.commands.options import RecordOptions
from manipnet_tools.commands.running_server import address_of, reach
from manipnet_tools.terminal import WARNING, open_console

POLL_MS: Final = 50
SILENT_S: Final = 1.0
"""Without a message for this long after the start, the user is told what is missing."""


class RecordingTarget(Protocol):
    """Takes what is recorded."""

    def write_bodies(self, frame: BodyFrame, now_ns: int) -> None: ...

    def write_hands(self, message: HandsMessage, now_ns: int) -> None: ...


class LateFile:
    """A recording whose file is created with its first message, so that a recording of nothing leaves no file."""

    def __init__(self, path: Path, about: Mapping[str, str], meshes: Mapping[str, bytes], replace: bool) -> None:
        self._path, self._about, self._meshes, self._replace = path, about, meshes, replace
        self._writer: RecordingWriter | None = None

    @property
    def is_empty(self) -> bool:
        """Whether nothing has arrived yet."""
        return self._writer is None

    def write_bodies(self, frame: BodyFrame, now_ns: int) -> None:
        """Write a frame that arrived at `now_ns`. Raises `OSError`."""
        self._open().write_bodies(frame, now_ns)

    def write_hands(self, message: HandsMessage, now_ns: int) -> None:
        """Write a message that arrived at `now_ns`. Raises `OSError`."""
        self._open().write_hands(message, now_ns)

    def counts(self) -> str:
        """How much has been recorded, in words."""
        counts = {} if self._writer is None else self._writer.counts
        return f"{counts.get(BODIES, 0)} frames of bodies, {counts.get(HANDS, 0)} hands messages"

    def close(self) -> None:
        """Finish the file, if there is one."""
        if self._writer is not None:
            self._writer.close()

    def _open(self) -> RecordingWriter:
        if self._writer is None:
            if self._replace:
                self._path.unlink(missing_ok=True)
            self._writer = RecordingWriter(self._path, self._about, self._meshes)
        return self._writer


def run(options: RecordOptions) -> None:
    """Record.

    Raises `RecordingError` if nothing arrived, `ConfigError` if no server answers, `MeshError`, `KeyFileError` and
    `OSError`.
    """
    console = open_console()
    metadata, meshes = read_rig(options.rig)
    hands: Endpoint | None = None
    if options.bodies_port is None:
        client, hello = reach(options.server, options.keys, lambda text: console.print(text, style=WARNING))
        hands = address_of("hands", hello, options.server)
        of_server, carried = ask_server(client, hello)
        metadata, meshes = of_server | metadata, meshes | carried
    recording = LateFile(options.out, metadata, meshes, options.force)
    begin_s = time.monotonic()
    try:
        _record(options, hands, recording, console)
    finally:
        recording.close()
    if recording.is_empty:
        waited_s = time.monotonic() - begin_s
        raise RecordingError(f"nothing arrived within {waited_s:.1f} s, so {options.out} was not written")
    console.print(f"wrote {options.out}: {recording.counts()}")


def _record(options: RecordOptions, hands: Endpoint | None, recording: LateFile, console: Console) -> None:
    """Record until the user, or `--seconds`, ends it."""
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with stop_on_signals() as stopping, Progress(*columns, console=console) as progress:
        task, begin_s = progress.add_task("waiting for data"), time.monotonic()
        expected, has_warned = "" if hands is None else _expected(tcp_address(hands)), False

        def unfinished() -> bool:
            nonlocal has_warned
            passed_s = time.monotonic() - begin_s
            progress.update(task, description=recording.counts())
            if recording.is_empty and expected and not has_warned and passed_s > SILENT_S:
                progress.print(expected, style=WARNING)
                has_warned = True
            return not (stopping.is_set() or (options.seconds is not None and passed_s >= options.seconds))

        def listening(where: str) -> None:
            nonlocal expected
            expected = f"nothing arrives at {where} yet; is the tracker running, and does it send to this address?"
            progress.print(f"listening on {where}")

        if hands is None:
            record_bodies(options.bodies_port or 0, recording, unfinished, listening)
        else:
            record_hands(hands, options.keys, options.actor, recording, unfinished)


def _expected(where: str) -> str:
    return f"no hands arrive from {where} yet: the server waits for tracked bodies; `manipnet doctor` says why"


def record_hands(
    server: Endpoint, keys: Path | None, actor: str | None, target: RecordingTarget, unfinished: Callable[[], bool]
) -> None:
    """Write every hands message of a server, and the bodies of one actor as body frames, while `unfinished()`."""
    client_keys = None if keys is None else read_client_keys(keys)
    # Without a high-water mark, no message is dropped while the disk is slow.
    with zmq.Context() as context, connect(context, zmq.SUB, server, client_keys, high_water_mark=0) as socket:
        socket.subscribe(TOPIC_MSGPACK)
        while unfinished():
            if socket.poll(POLL_MS):
                while socket.poll(0):
                    message = _decode(socket.recv())
                    actor = actor or message.actor
                    now_ns = time.time_ns()
                    if message.actor == actor and message.bodies:
                        target.write_bodies(bodies_of(message), now_ns)
                    target.write_hands(message, now_ns)


def record_bodies(
    port: int, target: RecordingTarget, unfinished: Callable[[], bool], listening: Callable[[str], None]
) -> None:
    """Write every body frame sent to `port` of this machine while `unfinished()`.

    Calls `listening` with the address as soon as senders may connect.
    """
    intake = ZEROMQ.intake(lambda frame: target.write_bodies(frame, time.time_ns()), Telemetry())
    receiver = ZmqBodies(intake, port=port)
    receiver.start()
    try:
        listening(receiver.address)
        while unfinished():
            time.sleep(1e-3 * POLL_MS)
    finally:
        receiver.stop()


def ask_server(server: ControlClient, hello: Mapping[str, Any]) -> tuple[dict[str, str], dict[str, bytes]]:
    """Metadata of a server that answered `hello`, and the meshes of its props by file name.

    Raises `RequestError` and `OSError`.
    """
    carried = server.ask("objects")["bodies"]
    actors = {body: actor for actor, props in reversed(carried.items()) for body in props}
    answers = {body: server.ask("mesh", actor=actor, body=body) for body, actor in actors.items()}
    metadata = {key: str(hello[key]) for key in ("session", "model", "model_hash", "version") if key in hello}
    objects = {body: {"object": answer["object"], "scale": answer["scale"]} for body, answer in answers.items()}
    meshes = {f"{body}.ply": _mesh_of(answer) for body, answer in answers.items()}
    return metadata | {"objects": json.dumps(objects)}, meshes


def _mesh_of(answer: dict[str, Any]) -> bytes:
    vertices = np.frombuffer(base64.b64decode(answer["vertices"]), "<f4").reshape(-1, 3)
    faces = np.frombuffer(base64.b64decode(answer["faces"]), "<u4").reshape(-1, 3)
    return mesh_file(vertices.astype(np.float64), faces, answer["scale"])


def read_rig(file: Path | None) -> tuple[dict[str, str], dict[str, bytes]]:
    """A rig file as metadata, and its meshes in metres. Raises `ConfigError`, `MeshError` and `OSError`."""
    if file is None:
        return {}, {}
    props = [prop for actor in load_rig(file).actors for prop in actor.objects]
    meshes = {prop.name: load_mesh(prop.mesh, prop.unit, prop.scale) for prop in reversed(props)}
    files = {f"{name}.ply": mesh_file(mesh.vertices, mesh.faces) for name, mesh in meshes.items()}
    return {"rig": file.read_text(encoding="utf-8")}, files


def _decode(raw: bytes) -> HandsMessage:
    try:
        return decode_msgpack(raw[len(TOPIC_MSGPACK) :])
    except MessageError as error:
        raise RecordingError(
            f"what arrives is not a hands message ({error}); update this program or the server"
        ) from None
