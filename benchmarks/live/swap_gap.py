"""What changing an object to a large mesh that is not in the cache costs the hands.

A real server plays the demo with an empty cache, and a body gets a mesh of 200,000 triangles, which the server prepares
first. The result is the longest time between two hands messages before and during that, and how soon the new object is
shown.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

import numpy as np
import trimesh

from benchmarks.support import Subscriber, serving
from manipnet.wire import HandsMessage
from manipnet_tools.bench.shapes import gourd

BEFORE_S = 10.0


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("triangles", nargs="?", type=int, default=200_000, help="of the mesh (default: %(default)d)")
    triangles = parser.parse_args().triangles
    with tempfile.TemporaryDirectory() as folder:
        os.environ["MANIPNET_CACHE"] = str(Path(folder) / "cache")
        objects = Path(folder) / "objects"
        objects.mkdir()
        mesh = gourd(triangles)
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(objects / "gourd.ply")
        with serving("--demo", "--objects", str(objects)) as server:
            subscriber = Subscriber(server.addresses["hands"])
            time.sleep(BEFORE_S)
            begin_s = time.monotonic()
            answer = server.ask({"op": "select_object", "body": "mug", "object": "gourd"})
            took_s = time.monotonic() - begin_s
            messages = [subscriber.next()]
            while messages[-1].seq < answer["seq"] + 60:
                messages.append(subscriber.next())
            subscriber.close()
    report(messages, begin_s, took_s, answer["seq"], len(mesh.faces))


def report(messages: list[HandsMessage], begin_s: float, took_s: float, seq: int, triangles: int) -> None:
    """Print the times between messages, by the clock of this machine, which is also the server's."""
    published_s = np.array([message.t_publish for message in messages])
    gaps_ms = 1e3 * np.diff(published_s)
    preparing = published_s[1:] >= begin_s
    first = next(message for message in messages if message.seq >= seq)
    print(f"{triangles} triangles, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores: prepared in {took_s:.1f} s")
    for name, gaps in (("before", gaps_ms[~preparing][60:]), ("during and after", gaps_ms[preparing])):
        print(f"{name}: between two messages p50 {np.median(gaps):.1f} ms, longest {gaps.max():.1f} ms")
    missing = int(messages[-1].seq - messages[0].seq + 1 - len(messages))
    late_ms = 1e3 * (first.t_publish - begin_s - took_s)
    print(f"{missing} messages missing; the first one with the new object came {late_ms:+.1f} ms after the reply")


if __name__ == "__main__":
    main()
