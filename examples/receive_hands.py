"""Receive hands: print once a second what the fingers do.

    python -m pip install ./clients/python
    manipnet-serve --demo
    python examples/receive_hands.py [tcp://127.0.0.1:5555]

`subscribe` yields the newest frame and skips those that a slow program missed. To draw at the rate of a display, use
`Client.sample`, which interpolates between frames; clients/ has the same for Unity, Unreal, Blender and browsers.
"""

import contextlib
import sys

from manipnet_client import Hand, subscribe

INDEX_TIP = 10
"""Its place among the 26 OpenXR joints."""


def main(address: str = "tcp://127.0.0.1:5555") -> None:
    """Print until interrupted."""
    shown_s = float("-inf")
    for hands in subscribe(address):
        if hands.t_publish - shown_s >= 1.0:
            shown_s = hands.t_publish
            print(f"frame {hands.seq}:", describe("left", hands.left), describe("right", hands.right), flush=True)


def describe(side: str, hand: Hand | None) -> str:
    """A hand in a few words: its state, what it holds, and where the tip of its index finger is."""
    if hand is None:
        return f"{side} is not tracked;"
    x, y, z = hand.joints[INDEX_TIP, :3]
    return f"{side} is {hand.state} on {hand.object}, index tip at ({x:.3f}, {y:.3f}, {z:.3f}) m;"


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        main(*sys.argv[1:])
