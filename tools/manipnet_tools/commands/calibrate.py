"""`manipnet calibrate`: counts down, then asks a running server to calibrate from the last seconds on the sheet."""

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from manipnet.common.options import ConfigError
from manipnet.control.client import ControlClient
from manipnet_tools.terminal import open_console

ANSWER_S = 10.0


@dataclass(frozen=True)
class CalibrateOptions:
    """Find where the wrists sit on their tracked bodies, and the size of the hands; see docs/calibration.md.

    Lay both hands flat on the sheet, wrists on the marks and fingers along the lines, and keep still until it is done.
    """

    server: Annotated[str, tyro.conf.arg(metavar="HOST:PORT")] = "127.0.0.1:5557"
    """Address of the server's control port."""
    actor: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """The actor to calibrate, if there are several."""
    hand: Literal["both", "left", "right"] = "both"
    """The hand that lies on the sheet."""
    hand_length: Annotated[float | None, tyro.conf.arg(metavar="METRES")] = None
    """Length from the middle of the wrist to the tip of the middle finger, read off the sheet's ruler."""
    fingertips: bool = False
    """Measure the hand length instead: draw the hands back until the middle fingertips touch the sheet's centre
    line."""
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """The sheet's centre in the world, metres (x y z; y is the height of the table)."""
    yaw: Annotated[float, tyro.conf.arg(metavar="DEGREES")] = 0.0
    """Rotation of the sheet about the vertical, counter-clockwise as seen from above."""
    reference: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Instead of --at: a prop of the rig that stands on the sheet's centre with its x axis to the operator's right."""
    countdown: Annotated[int, tyro.conf.arg(metavar="SECONDS")] = 5
    """Time to lay down the hands."""
    seconds: Annotated[float, tyro.conf.arg(metavar="SECONDS")] = 2.0
    """How long the hands must lie still."""
    dry_run: bool = False
    """Do not change the rig file; the calibration lasts until the server stops."""
    keys: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """The client's key file, for a server that requires keys (`manipnet keys make NAME`)."""


def run(options: CalibrateOptions) -> None:
    """Count down, calibrate and print the result. Raises `ConfigError` if the server refuses or does not answer."""
    console = open_console(stderr=False)
    ask(options, {"op": "ping"})  # a missing server is reported before the countdown, not after it
    for left in range(options.countdown, 0, -1):
        console.print(f"hands on the sheet in {left} …")
        time.sleep(1.0)
    console.print(f"keep still for {options.seconds:g} s …")
    time.sleep(options.seconds + 0.2)
    for line in report(ask(options, request(options))):
        console.print(line, highlight=False)


def request(options: CalibrateOptions) -> dict[str, Any]:
    """The control request that these options stand for."""
    fields: dict[str, Any] = {"op": "calibrate", "seconds": options.seconds, "hand": options.hand}
    fields |= {"store": not options.dry_run, "step": "fingertips" if options.fingertips else "wrists"}
    fields |= {"actor": options.actor, "hand_length": options.hand_length, "reference": options.reference}
    if options.reference is None:
        fields["sheet"] = [*options.at, math.radians(options.yaw)]
    return {key: value for key, value in fields.items() if value is not None}


def report(answer: dict[str, Any]) -> list[str]:
    """The lines to print for the server's answer."""
    lines = [f"{answer['quality']}: the hands are {answer['hand_scale']:.3f} times the size of the model's"]
    for part, hand in answer["hands"].items():
        lines.append(
            f"{part}: held still within {hand['spread_mm']:.1f} mm and {hand['spread_deg']:.2f}° "
            f"({hand['samples']} samples, {hand['outliers']} outliers ignored); "
            f"the calibration changed by {hand['changed_mm']:.1f} mm and {hand['changed_deg']:.1f}°"
        )
    lines.append(f"saved in {answer['stored']}; {answer['note']}" if answer["stored"] else answer["note"])
    return lines


def ask(options: CalibrateOptions, fields: dict[str, Any]) -> dict[str, Any]:
    """Send one request and return the answer. Raises `ConfigError` and `KeyFileError`."""
    try:
        return ControlClient(options.server, options.keys, ANSWER_S).ask(**fields)
    except TimeoutError as error:
        raise ConfigError(
            f"{error}: start it with manipnet-serve --rig FILE, or give the control address in its ready line as "
            "--server; a server with keys needs --keys FILE"
        ) from None
