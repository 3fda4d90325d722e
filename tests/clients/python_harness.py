"""Run the Python client for the tests, which talk to it in lines of text.

The commands are `decode FILES`, `interpolate`, `live ADDRESS` and `idle ADDRESS`, as in the other languages' harnesses.
"""

import json
import queue
import sys
import threading
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "clients" / "python"))
from manipnet_client import Client, Hands, Interpolator, MessageError, Shown, decode

HAND_ARRAYS = ("angles", "rotations", "wrist", "joints")


def describe(payload: bytes) -> dict:
    """A message as the other harnesses print it, or the error of decoding it."""
    try:
        hands = decode(payload)
    except MessageError as error:
        return {"error": str(error)}
    head = ("session", "actor", "seq", "t_capture", "t_publish", "look_ahead")
    by_side = {side: hand for side in ("left", "right") if (hand := hands.hand(side)) is not None}
    return {
        **{name: getattr(hands, name) for name in head},
        "latency_ms": list(hands.latency_ms),
        "hands": {
            side: {"state": hand.state, "object": hand.object, "scale": hand.scale}
            | {name: getattr(hand, name).ravel().tolist() for name in HAND_ARRAYS}
            for side, hand in by_side.items()
        },
        "bodies": [{"name": b.name, "tracked": b.tracked, "pose": b.pose.tolist()} for b in hands.bodies],
    }


def interpolate() -> None:
    """Execute the lines `delay S`, `push ARRIVAL HEX` and `show NOW` of standard input."""
    interpolator = Interpolator()
    for line in sys.stdin:
        verb, number, *data = line.split()
        if verb == "delay":
            interpolator.delay_s = float(number)
        elif verb == "push":
            print(int(interpolator.push(decode(bytes.fromhex(data[0])), float(number))))
        else:
            print(row(interpolator.sample(float(number))))


def row(shown: Shown | None) -> str:
    """The numbers of a shown frame that the tests compare, or "none"."""
    if shown is None or shown.hands.left is None:
        return "none"
    left, bodies = shown.hands.left, shown.hands.bodies
    values = [*left.wrist[[0, 5, 6]], left.angles[3], left.joints[25, 0], bodies[0].pose[0]]
    return " ".join(repr(float(x)) for x in (shown.weight, shown.hands.seq, *values))


class Display:
    """Shows hands as a program would, and records what it received and showed."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._newest: Hands | None = None
        self._shown: Shown | None = None
        self._due_s, self._shows = 0.0, 0
        self._arrivals: list[tuple[int, float]] = []

    def step(self) -> None:
        """Wait at most a millisecond for a frame, and show one when it is due."""
        fresh = self._client.wait(after=self._newest, timeout_s=0.001)
        if fresh is not None:
            self._newest = fresh
            stats = self._client.stats()
            self._arrivals.append((stats.seq, time.monotonic() - stats.age_s))
        if (now_s := time.monotonic()) >= self._due_s:
            self._due_s = now_s + 1 / 90
            self._shown = self._client.sample(now_s)
            self._shows += self._shown is not None

    def arrivals(self) -> list[tuple[int, float]]:
        """The number and time of every frame received since the last call."""
        arrivals, self._arrivals = self._arrivals, []
        return arrivals

    def figures(self) -> dict:
        """The statistics of the client and the frame shown last."""
        stats, shown = self._client.stats(), self._shown
        names = ("state", "received", "lost", "late", "refused", "connections", "seq", "rate_hz", "transit_s")
        return {name: getattr(stats, name) for name in names} | {
            "age_s": stats.age_s if np.isfinite(stats.age_s) else None,
            "weight": shown.weight if shown else 0.0,
            "shown_seq": shown.hands.seq if shown else 0,
            "session": shown.hands.session if shown else "",
            "shows": self._shows,
        }


def live(address: str) -> None:
    """Show at about 90 Hz until standard input ends; answer "arrivals" with arrivals, any other line with figures."""
    questions: queue.SimpleQueue[str | None] = queue.SimpleQueue()

    def listen() -> None:
        for line in sys.stdin:
            questions.put(line.strip())
        questions.put(None)

    threading.Thread(target=listen, daemon=True).start()
    with Client(address, delay_s=0.05) as client:
        display, question = Display(client), ""
        while question is not None:
            display.step()
            if not questions.empty() and (question := questions.get()) is not None:
                print(json.dumps(display.arrivals() if question == "arrivals" else display.figures()), flush=True)
    print("closed")


def idle(address: str) -> None:
    """Block the main thread and show nothing; print figures for every line of standard input."""
    with Client(address, delay_s=0.05) as client:
        display = Display(client)
        for _ in sys.stdin:
            print(json.dumps(display.figures()), flush=True)
    print("closed")


def main(verb: str, *words: str) -> None:
    if verb == "decode":
        for path in words:
            print(json.dumps(describe(Path(path).read_bytes())))
    else:
        {"interpolate": interpolate, "live": live, "idle": idle}[verb](*words)


if __name__ == "__main__":
    main(*sys.argv[1:])
