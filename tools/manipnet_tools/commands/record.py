"""`manipnet record`: writes the bodies and hands of a running server, or the bodies that a tracker sends."""

import base64
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import zmq
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from manipnet.common.options import parse_endpoint
from manipnet.config.rig_reader import load_rig
from manipnet.config.settings import all_options
from manipnet.control.client import ControlClient
from manipnet.inputs.zeromq import ZEROMQ
from manipnet.inputs.zeromq.receiver import ZmqBodies
from manipnet.net.curve_keys import read_client_keys
from manipnet.net.zmq_socket import connect
from manipnet.recording.mcap_file import BODIES, HANDS, RecordingError, RecordingWriter, bodies_of, mesh_file
from manipnet.runtime.signals import stop_on_signals
from manipnet.synthesis.objects.mesh import load_mesh
from manipnet.telemetry import Telemetry
from manipnet.wire import TOPIC_MSGPACK, HandsMessage, decode_msgpack
from manipnet.wire.bodies import MessageError
from manipnet_tools.commands.options import RecordOptions
from manipnet_tools.terminal import open_console

ANSWER_S = 3.0
POLL_MS = 50


def run(options: RecordOptions) -> None:
    """Record. Raises `RecordingError`, `ConfigError`, `MeshError`, `KeyFileError` and `OSError`."""
    metadata, meshes = read_rig(options.rig)
    if options.bodies_port is None:
        of_server, carried = ask_server(ControlClient(options.control, options.keys, ANSWER_S))
        metadata, meshes = of_server | metadata, meshes | carried
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    console = open_console()
    with (
        stop_on_signals() as stopping,
        RecordingWriter(options.out, metadata, meshes) as writer,
        Progress(*columns, console=console) as progress,
    ):
        task = progress.add_task("waiting for data")
        begin_s = time.monotonic()

        def unfinished() -> bool:
            progress.update(task, description=_counts(writer))
            time_is_up = options.seconds is not None and time.monotonic() - begin_s >= options.seconds
            return not (stopping.is_set() or time_is_up)

        if options.bodies_port is not None:
            record_bodies(
                options.bodies_port, writer, unfinished, lambda where: progress.print(f"listening on {where}")
            )
        else:
            record_hands(options.server, options.keys, options.actor, writer, unfinished)
    console.print(f"wrote {options.out}: {_counts(writer)}")


def record_hands(
    server: str, keys: Path | None, actor: str | None, writer: RecordingWriter, unfinished: Callable[[], bool]
) -> None:
    """Write every hands message of a server, and the bodies of one actor as body frames, while `unfinished()`."""
    endpoint = parse_endpoint(server, all_options()["port"].default)
    client_keys = None if keys is None else read_client_keys(keys)
    # Without a high-water mark, no message is dropped while the disk is slow.
    with zmq.Context() as context, connect(context, zmq.SUB, endpoint, client_keys, high_water_mark=0) as socket:
        socket.subscribe(TOPIC_MSGPACK)
        while unfinished():
            if socket.poll(POLL_MS):
                while socket.poll(0):
                    message = _decode(socket.recv())
                    actor = actor or message.actor
                    now_ns = time.time_ns()
                    if message.actor == actor and message.bodies:
                        writer.write_bodies(bodies_of(message), now_ns)
                    writer.write_hands(message, now_ns)


def record_bodies(
    port: int, writer: RecordingWriter, unfinished: Callable[[], bool], listening: Callable[[str], None]
) -> None:
    """Write every body frame sent to `port` of this machine while `unfinished()`.

    Calls `listening` with the address as soon as senders may connect.
    """
    intake = ZEROMQ.intake(lambda frame: writer.write_bodies(frame, time.time_ns()), Telemetry())
    receiver = ZmqBodies(intake, port=port)
    receiver.start()
    try:
        listening(receiver.address)
        while unfinished():
            time.sleep(1e-3 * POLL_MS)
    finally:
        receiver.stop()


def ask_server(server: ControlClient) -> tuple[dict[str, str], dict[str, bytes]]:
    """Metadata of a running server and the meshes of its props by file name; both empty if it does not answer."""
    try:
        hello, carried = server.ask("hello"), server.ask("objects")["bodies"]
        actors = {body: actor for actor, props in reversed(carried.items()) for body in props}
        answers = {body: server.ask("mesh", actor=actor, body=body) for body, actor in actors.items()}
    except TimeoutError:
        return {}, {}
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
            f"what arrives is not a hands message ({error}); does --server name the port of the hands?"
        ) from None


def _counts(writer: RecordingWriter) -> str:
    return f"{writer.counts[BODIES]} frames of bodies, {writer.counts[HANDS]} hands messages"
