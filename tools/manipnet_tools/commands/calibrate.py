"""`manipnet calibrate`: counts down, then asks a running server to calibrate from the last seconds on the sheet."""

import math
import time
from typing import Any

from manipnet.common.options import ConfigError
from manipnet.control.client import ControlClient
from manipnet_tools.commands.options import CalibrateOptions
from manipnet_tools.commands.running_server import no_answer, reach
from manipnet_tools.terminal import WARNING, open_console

ANSWER_S = 10.0


def run(options: CalibrateOptions) -> None:
    """Count down, calibrate and print the result. Raises `ConfigError` if the server refuses or does not answer."""
    console = open_console(stderr=False)
    warn = open_console()
    reach(options.server, options.keys, lambda text: warn.print(text, style=WARNING))  # before the countdown
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
    except TimeoutError:
        raise ConfigError(no_answer(options.server, options.keys, ANSWER_S)) from None
