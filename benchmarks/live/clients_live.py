"""Losses, age, garbage, stalls and reconnections of every engine-free client on a real server that plays a take.

Each client first reads alone for the given time and is then stopped for five seconds. At the end all are connected
while the server is killed and started again, twice. Without a take the demo is played. The result is a table with a row
per client; the exit status is 1 if a limit is not met.

`age` is how old a hand is when it arrives: its arrival minus the instant it shows, both by this machine's clock, minus
the look-ahead. A client records the arrivals by itself and gets no questions while it reads.
"""

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from benchmarks.support import ROOT, LiveClient, LiveServer, build, serving
from benchmarks.traffic import Received, receiving
from manipnet.demo.player import DEMO_FILE, DEMO_OBJECTS
from manipnet.synthesis.objects.library import LIBRARY_FOLDER

NAMES = ("csharp", "clang", "javascript", "python")
PORT_OPTIONS = {"hands": "port", "bodies": "input-port", "web": "web-port"}
"""The options of the ports that a restarted server keeps."""
AGE_LIMIT_S, BACK_LIMIT_S = 0.020, 2.0
STALL_S = 5.0
WARM_FRAMES = 180
"""By then every slot of a client's ring has held a frame with as many bodies, and its memory stays constant."""


@contextmanager
def playing_take(take: Path, address: str) -> Iterator[None]:
    """Stream a take to the server at `address` during the block, by `play_take` as a separate process."""
    command = [sys.executable, "-m", "benchmarks.live.play_take", str(take), address]
    process = subprocess.Popen(command, cwd=ROOT)
    try:
        yield
    finally:
        process.kill()
        process.wait()


def ages(arrivals: list[list[float]], received: Received) -> list[float]:
    """Sorted ages on arrival, seconds.

    A client checks a thousand times a second which frame is newest; if it finds two new frames at once, both count as
    having arrived with the later one.
    """
    due_s = {message.seq: message.t_capture + message.look_ahead for message in received.messages}
    found, before = [], int(arrivals[0][0]) - 1
    for seq, arrived_s in arrivals:
        found += [arrived_s - due_s[k] for k in range(before + 1, int(seq) + 1) if k in due_s]
        before = int(seq)
    return sorted(found)


def read(client: LiveClient, received: Received, seconds: float) -> dict:
    """Leave the client alone for a while; returns its losses, ages and garbage."""
    client.ask_until(lambda f: f["received"] - f["late"] > WARM_FRAMES, 60.0)
    client.ask("arrivals")
    first, memory = client.ask(), footprint(client.process.pid)["VmRSS"]
    time.sleep(seconds)
    last = client.ask()
    memory = footprint(client.process.pid)["VmRSS"] - memory
    known = ages(client.ask("arrivals"), received)
    garbage = last.get("collections", last.get("allocations"))
    return {
        "frames": last["received"] - first["received"],
        "lost": last["lost"] - first["lost"],
        "age p50 ms": round(1e3 * known[len(known) // 2], 1),
        "age p99 ms": round(1e3 * known[int(0.99 * len(known))], 1),
        "garbage": "-" if garbage is None else garbage,
        "kB more": memory,
    }


def stall(client: LiveClient, received: Received) -> dict:
    """Stop the client; after it continues, it must show the newest frames and no backlog."""
    held = client.ask()["shown_seq"]
    os.kill(client.process.pid, signal.SIGSTOP)
    time.sleep(STALL_S)
    newest, seen = received.messages[-1].seq, []
    os.kill(client.process.pid, signal.SIGCONT)
    resumed = time.monotonic()
    while not seen or seen[-1] < newest - 5:
        seen.append(client.ask()["shown_seq"])
    backlog = [s for s in seen if held + 20 < s < newest - 20]
    return {"missed": newest - held, "backlog shown": len(backlog), "resumed s": round(time.monotonic() - resumed, 2)}


def footprint(pid: int) -> dict[str, int]:
    """Resident kilobytes, threads and open files of a process."""
    lines = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    found = {key: int(lines[key].split()[0]) for key in ("VmRSS", "Threads")}
    return {**found, "files": len(os.listdir(f"/proc/{pid}/fd"))}


def reconnection(clients: dict[str, LiveClient], ready_s: float, known: dict[str, dict]) -> dict[str, dict]:
    """How soon after the server is ready each client is connected and has its first frame."""
    back: dict[str, dict] = {name: {} for name in clients}
    while any(len(figures) < 2 for figures in back.values()):
        if time.monotonic() > ready_s + 60.0:
            raise SystemExit(f"some clients did not reconnect within a minute: {back}")
        for name, client in clients.items():
            figures = client.ask()
            if figures["connections"] > known[name]["connections"]:
                back[name].setdefault("back s", round(time.monotonic() - ready_s, 2))
            if figures["received"] > known[name]["received"]:
                back[name].setdefault("first frame s", round(time.monotonic() - ready_s, 2))
    return back


def restarts(clients: dict[str, LiveClient], server: LiveServer, start: Callable[[], LiveServer]) -> dict[str, dict]:
    """Kill the server and `start` it again, twice; returns how soon clients are back and what they leaked the second
    time."""
    rows: dict[str, dict] = {}
    for _ in range(2):
        known = {name: client.ask() for name, client in clients.items()}
        before = {name: footprint(client.process.pid) for name, client in clients.items()}
        server.stop(signal.SIGKILL)
        server = start()
        rows = reconnection(clients, time.monotonic(), known)
        for name, client in clients.items():
            after = footprint(client.process.pid)
            rows[name]["threads more"] = after["Threads"] - before[name]["Threads"]
            rows[name]["files more"] = after["files"] - before[name]["files"]
    return rows


def check(rows: dict[str, dict], closed: dict[str, tuple[str, int]]) -> bool:
    """Print the table; returns whether every limit is met."""
    headings = list(next(iter(rows.values())))
    print(f"\n| client | {' | '.join(headings)} |\n|---|{'---|' * len(headings)}")
    good = True
    for name, row in rows.items():
        limits = {
            "frames lost": row["lost"] == 0,
            "age": row["age p99 ms"] < 1e3 * AGE_LIMIT_S,
            "garbage": row["garbage"] in (0, "-"),
            "backlog shown": row["backlog shown"] == 0,
            "time to reconnect": row["back s"] < BACK_LIMIT_S,
            "leak": row["threads more"] <= 0 and row["files more"] <= 0,
            "end": closed[name] == ("closed", 0),
        }
        broken = [what for what, is_met in limits.items() if not is_met]
        good &= not broken
        print(f"| {name} | {' | '.join(map(str, row.values()))} | {'NOT MET: ' + ', '.join(broken) if broken else ''}")
    return good


def connected(stack: ExitStack, name: str, command: list[str], addresses: dict[str, str]) -> LiveClient:
    """Start a client and wait until it receives."""
    client = LiveClient.start(command, addresses["web" if name == "javascript" else "hands"])
    stack.callback(client.kill)
    client.ask_until(lambda f: f["received"] > 0, 60.0)
    return client


def run(take: Path, meshes: list[str], seconds: float) -> bool:
    """Measure everything; returns whether every limit is met."""
    options = [f"--mesh={mesh}" for mesh in meshes]
    rows: dict[str, dict] = {}
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        commands = {name: build(name, folder) for name in NAMES}
        server = stack.enter_context(serving(*options))
        addresses = server.addresses
        stack.enter_context(playing_take(take, addresses["bodies"]))
        with receiving(addresses["hands"]) as received:
            for name, command in commands.items():
                client = connected(stack, name, command, addresses)
                rows[name] = read(client, received, seconds) | stall(client, received)
                print(f"{name}: {rows[name]}, load {os.getloadavg()[0]:.1f}", flush=True)
                client.close()
        clients = {name: connected(stack, name, command, addresses) for name, command in commands.items()}
        ports = [f"--{option}={addresses[name].rpartition(':')[2]}" for name, option in PORT_OPTIONS.items()]
        back = restarts(clients, server, lambda: stack.enter_context(serving(*options, *ports)))
        closed = {name: client.close() for name, client in clients.items()}
        return check({name: rows[name] | back[name] for name in rows}, closed)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="to read with each client (default: %(default)g)")
    parser.add_argument("--take", type=Path, default=DEMO_FILE, help="the take to play (default: the demo)")
    parser.add_argument("--mesh", action="append", default=[], metavar="NAME=FILE", help="an object's mesh; repeatable")
    options = parser.parse_args()
    meshes = options.mesh or [f"{name}={LIBRARY_FOLDER / name}.ply" for name in DEMO_OBJECTS]
    return 0 if run(options.take, meshes, options.seconds) else 1


if __name__ == "__main__":
    sys.exit(main())
