"""`manipnet calibrate`: counts down, then asks a running server to look back at the hands on the sheet."""

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import msgpack
import tyro
import zmq
from rich.console import Console

from manipnet.common.options import ConfigError
from manipnet.net.curve_keys import read_client_keys
from manipnet.net.zap import secure_client

ANSWER_S = 10.0


@dataclass(frozen=True)
class CalibrateOptions:
    """Find where the wrists sit on their tracked bodies, and how large the hands are; see docs/calibration.md.

    Lay both hands flat on the sheet, wrists on the marks, fingers along the lines, and keep still until it is done.
    """

    server: str = "tcp://127.0.0.1:5557"
    """Control address of the running server."""
    actor: str | None = None
    """Whose hands, with several actors."""
    hand: Literal["both", "left", "right"] = "both"
    """Which hand is shown."""
    hand_length: float | None = None
    """Metres from the middle of the wrist to the tip of the middle finger, read off the sheet's ruler."""
    fingertips: bool = False
    """Measure the hand length instead: hands drawn back until the middle fingertips touch the sheet's centre line."""
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the sheet's centre is in the world, metres (x y z; y is the table's height)."""
    yaw: float = 0.0
    """How far the sheet is turned about the vertical, degrees, counter-clockwise from above."""
    reference: str | None = None
    """A prop of the rig that stands on the sheet's centre, its x axis to the operator's right; instead of --at."""
    countdown: Annotated[int, tyro.conf.arg(metavar="SECONDS")] = 5
    """Time to lay the hands down."""
    seconds: float = 2.0
    """How long they are held still."""
    dry_run: bool = False
    """Leave the rig file as it is; the calibration lasts until the server stops."""
    keys: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Keys for a server that asks for them (`manipnet keys make NAME`)."""


def run(options: CalibrateOptions) -> None:
    """Count down, ask, tell. Raises `ConfigError` with the server's reason when it refuses."""
    console = Console()
    ask(options, {"op": "ping"})  # better told now than after the countdown
    for left in range(options.countdown, 0, -1):
        console.print(f"hands on the sheet in {left} …")
        time.sleep(1.0)
    console.print(f"hold still for {options.seconds:g} s …")
    time.sleep(options.seconds + 0.2)
    for line in report(ask(options, request(options))):
        console.print(line, highlight=False)


def request(options: CalibrateOptions) -> dict[str, Any]:
    """The control request of these options."""
    asked: dict[str, Any] = {"op": "calibrate", "seconds": options.seconds, "hand": options.hand}
    asked |= {"store": not options.dry_run, "step": "fingertips" if options.fingertips else "wrists"}
    asked |= {"actor": options.actor, "hand_length": options.hand_length, "reference": options.reference}
    if options.reference is None:
        asked["sheet"] = [*options.at, math.radians(options.yaw)]
    return {key: value for key, value in asked.items() if value is not None}


def report(answer: dict[str, Any]) -> list[str]:
    """What a person wants to know of the server's answer."""
    lines = [f"{answer['quality']}: hands {answer['hand_scale']:.3f} times the model's"]
    for part, hand in answer["hands"].items():
        lines.append(
            f"{part}: still within {hand['spread_mm']:.1f} mm and {hand['spread_deg']:.2f}° "
            f"({hand['samples']} samples, {hand['outliers']} left out); "
            f"changed by {hand['changed_mm']:.1f} mm and {hand['changed_deg']:.1f}°"
        )
    lines.append(f"kept in {answer['stored']}; {answer['note']}" if answer["stored"] else answer["note"])
    return lines


def ask(options: CalibrateOptions, asked: dict[str, Any]) -> dict[str, Any]:
    """One request to the server and its answer. Raises `ConfigError`."""
    with zmq.Context() as context, context.socket(zmq.REQ) as socket:
        socket.setsockopt(zmq.LINGER, 0)
        if options.keys is not None:
            secure_client(socket, read_client_keys(options.keys))
        try:
            socket.connect(options.server)
        except zmq.ZMQError as error:
            raise ConfigError(f"--server {options.server}: {error}; give it as tcp://HOST:5557") from None
        socket.send(msgpack.packb(asked) or b"")
        if not socket.poll(int(1e3 * ANSWER_S)):
            raise ConfigError(
                f"no server answers at {options.server}: start it with manipnet-serve --rig FILE, or give its control "
                "address (in its ready line) as --server; one with keys needs --keys FILE"
            )
        answer = msgpack.unpackb(socket.recv())
    if "error" in answer:
        raise ConfigError(answer["error"])
    return answer
