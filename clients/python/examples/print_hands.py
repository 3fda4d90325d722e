"""Print a line a second about the hands that arrive.

`python print_hands.py [tcp://127.0.0.1:5555 [stage-pc.toml]]`; the second argument names a file of keys.
"""

import sys
import time

import manipnet_client as manipnet


def main() -> None:
    address = sys.argv[1] if len(sys.argv) > 1 else "tcp://127.0.0.1:5555"
    keys = sys.argv[2] if len(sys.argv) > 2 else None
    with manipnet.Client(address, keys=keys) as client:
        while True:
            time.sleep(1.0)
            stats, hands = client.stats(), client.newest
            line = f"{stats.state}: {stats.rate_hz:.1f} Hz, {stats.lost} lost"
            for side in ("left", "right"):
                if hands and (hand := hands.hand(side)):
                    line += f"   {side} {hand.state} {hand.object or ''}"
            print(line, flush=True)


if __name__ == "__main__":
    main()
