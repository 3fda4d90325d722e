"""`manipnet record`: what a running server hears of the bodies and says of the hands, or what a tracker sends."""

import base64
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
import zmq
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from manipnet.common.options import parse_endpoint
from manipnet.config.rig_reader import load_rig
from manipnet.inputs.zeromq import ZEROMQ
from manipnet.inputs.zeromq.receiver import ZmqBodies
from manipnet.net.curve_keys import read_client_keys
from manipnet.net.zap import secure_client
from manipnet.net.zmq_socket import MAX_WIRE_BYTES
from manipnet.recording.mcap_file import BODIES, HANDS, RecordingError, RecordingWriter, bodies_of, mesh_file
from manipnet.synthesis.objects.mesh import load_mesh
from manipnet.telemetry import Telemetry
from manipnet.wire import TOPIC_MSGPACK, HandsMessage, decode_msgpack
from manipnet.wire.bodies import MessageError
from manipnet_tools.signals import stop_on_signals

HANDS_PORT = 5555
CONTROL_PORT = 5557
ANSWER_MS = 3_000
POLL_MS = 50


@dataclass(frozen=True)
class RecordOptions:
    """Record until Ctrl-C, or for --seconds.

    From a running server: its hands and, at 60 Hz, the bodies they were made from.

    Without a server (--bodies-port): the bodies a tracker sends here, as they come.
    """

    out: Annotated[Path, tyro.conf.arg(metavar="FILE")]
    """The file to write, .mcap; it must not exist."""
    server: Annotated[str, tyro.conf.arg(metavar="HOST:PORT")] = "127.0.0.1:5555"
    """Where the server's hands are."""
    bodies_port: Annotated[int | None, tyro.conf.arg(metavar="PORT")] = None
    """Instead: listen here, in the place of a server, for senders of bodies over ZeroMQ."""
    control: Annotated[str, tyro.conf.arg(metavar="HOST:PORT")] = "127.0.0.1:5557"
    """Where the server takes requests: it is asked about its model and objects."""
    actor: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Whose bodies to record where there are several actors; by default the first one's that is heard."""
    rig: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """The server's rig file: it and its meshes are kept in the recording."""
    keys: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """The client's key file, where the server asks for one."""
    seconds: Annotated[float | None, tyro.conf.arg(metavar="SECONDS")] = None
    """Stop after this long."""


def run(options: RecordOptions) -> None:
    """Record. Raises `RecordingError`, `ConfigError`, `MeshError`, `KeyFileError` and `OSError`."""
    about, meshes = read_rig(options.rig)
    if options.bodies_port is None:
        told, props = ask_server(options.control, options.keys)
        about, meshes = told | about, meshes | props
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with (
        stop_on_signals() as stopping,
        RecordingWriter(options.out, about, meshes) as writer,
        Progress(*columns, console=Console(stderr=True)) as progress,
    ):
        task = progress.add_task("waiting for data")
        begin_s = time.monotonic()

        def going_on() -> bool:
            progress.update(task, description=_counts(writer))
            too_long = options.seconds is not None and time.monotonic() - begin_s >= options.seconds
            return not (stopping.is_set() or too_long)

        if options.bodies_port is not None:
            record_bodies(options.bodies_port, writer, going_on, lambda where: progress.print(f"listening on {where}"))
        else:
            record_hands(options.server, options.keys, options.actor, writer, going_on)
    Console(stderr=True).print(f"wrote {options.out}: {_counts(writer)}")


def record_hands(
    server: str, keys: Path | None, actor: str | None, writer: RecordingWriter, going_on: Callable[[], bool]
) -> None:
    """Write every hands message of a server, and the bodies of one actor as body frames, while `going_on`."""
    with zmq.Context() as context, context.socket(zmq.SUB) as socket:
        socket.setsockopt(zmq.RCVHWM, 0)  # nothing of a recording is dropped while a disk is slow
        socket.subscribe(TOPIC_MSGPACK)
        _connect(socket, server, HANDS_PORT, keys)
        while going_on():
            if socket.poll(POLL_MS):
                while socket.poll(0):
                    message = _decode(socket.recv())
                    actor = actor or message.actor
                    now_ns = time.time_ns()
                    if message.actor == actor and message.bodies:
                        writer.write_bodies(bodies_of(message), now_ns)
                    writer.write_hands(message, now_ns)


def record_bodies(
    port: int, writer: RecordingWriter, going_on: Callable[[], bool], listening: Callable[[str], None]
) -> None:
    """Write every body frame sent to this machine's `port` while `going_on`; `listening` hears the address."""
    intake = ZEROMQ.intake(lambda frame: writer.write_bodies(frame, time.time_ns()), Telemetry())
    receiver = ZmqBodies(intake, port=port)
    receiver.start()
    try:
        listening(receiver.address)
        while going_on():
            time.sleep(1e-3 * POLL_MS)
    finally:
        receiver.stop()


def ask_server(control: str, keys: Path | None) -> tuple[dict[str, str], dict[str, bytes]]:
    """Metadata of a running server and the meshes its bodies carry; nothing when it does not answer."""
    with zmq.Context() as context, context.socket(zmq.REQ) as socket:
        _connect(socket, control, CONTROL_PORT, keys)
        try:
            hello, carried = _ask(socket, op="hello"), _ask(socket, op="objects")["bodies"]
            where = {name: actor for actor, props in reversed(carried.items()) for name in props}
            answers = {name: _ask(socket, op="mesh", actor=actor, body=name) for name, actor in where.items()}
        except TimeoutError:
            return {}, {}
    about = {key: str(hello[key]) for key in ("session", "model", "model_hash", "version") if key in hello}
    objects = {name: {"object": answer["object"], "scale": answer["scale"]} for name, answer in answers.items()}
    meshes = {f"{name}.ply": _mesh_of(answer) for name, answer in answers.items()}
    return about | {"objects": json.dumps(objects)}, meshes


def _ask(socket: zmq.Socket, **request: str) -> dict[str, Any]:
    socket.send(json.dumps(request).encode())
    if not socket.poll(ANSWER_MS):
        raise TimeoutError
    return json.loads(socket.recv())


def _mesh_of(answer: dict[str, Any]) -> bytes:
    vertices = np.frombuffer(base64.b64decode(answer["vertices"]), "<f4").reshape(-1, 3)
    faces = np.frombuffer(base64.b64decode(answer["faces"]), "<u4").reshape(-1, 3)
    return mesh_file(vertices.astype(np.float64), faces, answer["scale"])


def read_rig(file: Path | None) -> tuple[dict[str, str], dict[str, bytes]]:
    """A rig file as metadata, and its meshes in metres. Raises `ConfigError`, `MeshError` and `OSError`."""
    if file is None:
        return {}, {}
    things = [thing for actor in load_rig(file).actors for thing in actor.objects]
    meshes = {thing.name: load_mesh(thing.mesh, thing.unit, thing.scale) for thing in reversed(things)}
    files = {f"{name}.ply": mesh_file(mesh.vertices, mesh.faces) for name, mesh in meshes.items()}
    return {"rig": file.read_text(encoding="utf-8")}, files


def _connect(socket: zmq.Socket, address: str, default_port: int, keys: Path | None) -> None:
    host, port = parse_endpoint(address, default_port)
    socket.setsockopt(zmq.LINGER, 0)
    socket.setsockopt(zmq.MAXMSGSIZE, MAX_WIRE_BYTES)
    socket.setsockopt(zmq.IPV6, int(":" in host))
    if keys is not None:
        secure_client(socket, read_client_keys(keys))
    socket.connect(f"tcp://[{host}]:{port}" if ":" in host else f"tcp://{host}:{port}")


def _decode(raw: bytes) -> HandsMessage:
    try:
        return decode_msgpack(raw[len(TOPIC_MSGPACK) :])
    except MessageError as error:
        raise RecordingError(f"what arrives is no hands message: {error}; is --server the hands' port?") from None


def _counts(writer: RecordingWriter) -> str:
    return f"{writer.counts[BODIES]} frames of bodies, {writer.counts[HANDS]} hands messages"
