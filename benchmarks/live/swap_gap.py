"""What a swap to a mesh that nobody prepared costs the hands: `python benchmarks/live/swap_gap.py [TRIANGLES]`.

A real server performs the demo with an empty cache; a body is given a mesh of 200,000 triangles, which is built first.
Printed are the longest time between two hands messages before and during that, and how soon the new object was shown.
"""

import os
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "support"))

from live_server import Subscriber, serving

from manipnet.wire import HandsMessage
from manipnet_tools.bench.shapes import gourd

BEFORE_S = 10.0


def main() -> None:
    """Measure and print."""
    triangles = int(sys.argv[1]) if len(sys.argv) > 1 else 200_000
    with tempfile.TemporaryDirectory() as folder:
        os.environ["MANIPNET_CACHE"] = str(Path(folder) / "cache")
        objects = Path(folder) / "objects"
        objects.mkdir()
        mesh = gourd(triangles)
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(objects / "gourd.ply")
        with serving("--demo", "--objects", str(objects)) as server:
            subscriber = Subscriber(server.addresses["hands"])
            time.sleep(BEFORE_S)
            answer: dict = {}
            begin_s = time.monotonic()
            asked = {"op": "select_object", "body": "mug", "object": "gourd"}
            asker = threading.Thread(target=lambda: answer.update(server.ask(asked)))
            asker.start()
            asker.join()
            took_s = time.monotonic() - begin_s
            messages = [subscriber.next()]
            while messages[-1].seq < answer["seq"] + 60:
                messages.append(subscriber.next())
            subscriber.close()
    report(messages, begin_s, took_s, answer["seq"], len(mesh.faces))


def report(messages: list[HandsMessage], begin_s: float, took_s: float, seq: int, triangles: int) -> None:
    """Gaps are of the server's clock, which is this machine's."""
    published_s = np.array([message.t_publish for message in messages])
    gaps_ms = 1e3 * np.diff(published_s)
    built = published_s[1:] >= begin_s
    first = next(message for message in messages if message.seq >= seq)
    print(f"{triangles} triangles, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores: built in {took_s:.1f} s")
    for name, gaps in (("before", gaps_ms[~built][60:]), ("during and after", gaps_ms[built])):
        print(f"{name}: between two messages p50 {np.median(gaps):.1f} ms, longest {gaps.max():.1f} ms")
    missing = int(messages[-1].seq - messages[0].seq + 1 - len(messages))
    late_ms = 1e3 * (first.t_publish - begin_s - took_s)
    print(f"{missing} messages missing; the first with the new object {late_ms:+.1f} ms after the answer")


if __name__ == "__main__":
    main()
