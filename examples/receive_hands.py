"""Receive hands: print a line a second about the fingers that a server publishes.

    manipnet-serve --demo
    python examples/receive_hands.py [tcp://127.0.0.1:5555]

Each ZeroMQ message is a topic, one space, and a msgpack map; docs/reference/protocol.md lists its keys. To draw hands at
a display's rate, use the client of your engine in clients/, which interpolates between messages.
"""

import sys

import msgpack
import zmq

TOPIC = b"pose/msgpack "


def main(address: str = "tcp://127.0.0.1:5555") -> None:
    """Print until interrupted."""
    socket = zmq.Context.instance().socket(zmq.SUB)
    socket.subscribe(TOPIC)
    socket.connect(address)
    shown_s = float("-inf")
    while True:
        hands = msgpack.unpackb(socket.recv()[len(TOPIC) :])
        if hands["t_publish"] - shown_s < 1.0:
            continue  # 60 messages arrive in a second; a line for each would be too many
        shown_s = hands["t_publish"]
        print(f"frame {hands['seq']}", *(describe(side, hand) for side, hand in hands["hands"].items()), sep="  ", flush=True)


def describe(side: str, hand: dict) -> str:
    """A hand in a few words: what it is doing, and where the tip of its index finger is."""
    x, y, z = hand["joints"][10][:3]  # OpenXR order: 10 is INDEX_TIP
    return f"{side} is {hand['state']} on {hand['object']}, index tip at ({x:.3f}, {y:.3f}, {z:.3f}) m"


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except KeyboardInterrupt:
        pass
