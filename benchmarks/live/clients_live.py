"""Every engine-free client on a real server that a take is replayed to: losses, age, garbage, stalls, restarts.

`python benchmarks/live/clients_live.py [--seconds 60] [--take TAKE --mesh NAME=FILE …]`; without a take it is the
demo's. Each client first reads alone for the time given and is then stopped for five seconds; at last all are connected
while the server is killed and started again, twice. Prints a row of a table per client and fails on a limit.

`age` is what a hand is old when it arrives: arrival minus the instant it shows, both on this machine's clock, minus the
look-ahead. Nothing is asked of a client while it reads: it notes the arrivals itself.
"""

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import zmq

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "tests" / "support")]
from languages import LiveClient, build  # noqa: E402

from manipnet.demo.player import DEMO_OBJECTS  # noqa: E402
from manipnet.synthesis.objects.library import LIBRARY_FOLDER  # noqa: E402
from manipnet.wire import TOPIC_BIN, decode_binary  # noqa: E402

NAMES = ("csharp", "clang", "javascript", "python")
DEMO = ROOT / "server" / "manipnet" / "demo" / "demo.mcap"
AGE_LIMIT_S, BACK_LIMIT_S = 0.020, 2.0
STALL_S = 5.0
WARM_FRAMES = 180
"""Until every place of the client's ring has held a frame with as many bodies; then its memory is what it stays."""


@contextmanager
def running(*words: str) -> Iterator[subprocess.Popen]:
    """A process that is killed in the end."""
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@contextmanager
def server(options: list[str], ports: dict[str, str]) -> Iterator[tuple[subprocess.Popen, dict[str, str]]]:
    """A server that is ready, with its addresses by name; on `ports` where it is told."""
    names = {"port": "hands", "input-port": "bodies", "control-port": "control", "osc-port": "osc", "page-port": "page"}
    words = [f"--{option}={ports.get(name, '0')}" for option, name in (names | {"web-port": "web"}).items()]
    with running(sys.executable, "-m", "manipnet.cli", *words, *options) as process:
        assert process.stdout is not None
        told = process.stdout.readline().split()
        if not told:
            raise SystemExit("the server ended without being ready")
        threading.Thread(target=process.stdout.read, daemon=True).start()  # it goes on telling
        yield process, dict(zip(told[1::2], told[2::2], strict=True))


class Observer:
    """Notes of what every message shows: its instant plus look-ahead, by number."""

    def __init__(self, address: str) -> None:
        self.due_s: dict[int, float] = {}
        self._socket = zmq.Context.instance().socket(zmq.SUB)
        self._socket.subscribe(TOPIC_BIN)
        self._socket.connect(address)
        threading.Thread(target=self._run, daemon=True).start()

    @property
    def newest(self) -> int:
        """The newest message's number; waits for the first."""
        while not self.due_s:
            time.sleep(0.01)
        return next(reversed(self.due_s))

    def _run(self) -> None:
        while True:
            message = decode_binary(self._socket.recv()[len(TOPIC_BIN) :])
            self.due_s[message.seq] = message.t_capture + message.look_ahead


def ages(arrivals: list[list[float]], due_s: dict[int, float]) -> list[float]:
    """Ages on arrival, sorted. A client notes a thousand times a second what is newest; what two frames brought at once
    counts as having come with the later."""
    found, before = [], int(arrivals[0][0]) - 1
    for seq, arrived_s in arrivals:
        found += [arrived_s - due_s[k] for k in range(before + 1, int(seq) + 1) if k in due_s]
        before = int(seq)
    return sorted(found)


def read(client: LiveClient, observer: Observer, seconds: float) -> dict:
    """Let the client alone; then its losses, ages and garbage."""
    client.ask_until(lambda f: f["received"] - f["late"] > WARM_FRAMES, 60.0)
    client.ask("arrivals")
    first, memory = client.ask(), footprint(client.process.pid)["VmRSS"]
    time.sleep(seconds)
    last = client.ask()
    memory = footprint(client.process.pid)["VmRSS"] - memory
    known = ages(client.ask("arrivals"), observer.due_s)
    garbage = last.get("collections", last.get("allocations"))
    return {
        "frames": last["received"] - first["received"],
        "lost": last["lost"] - first["lost"],
        "age p50 ms": round(1e3 * known[len(known) // 2], 1),
        "age p99 ms": round(1e3 * known[int(0.99 * len(known))], 1),
        "garbage": "-" if garbage is None else garbage,
        "kB more": memory,
    }


def stall(client: LiveClient, observer: Observer) -> dict:
    """Stop the client: what it shows when it goes on must be new."""
    held = client.ask()["shown_seq"]
    os.kill(client.process.pid, signal.SIGSTOP)
    time.sleep(STALL_S)
    newest, seen = observer.newest, []
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


def comeback(clients: dict[str, LiveClient], ready_s: float, known: dict[str, dict]) -> dict[str, dict]:
    """How soon after the server was ready each client is connected, and has its first frame."""
    back: dict[str, dict] = {name: {} for name in clients}
    while any(len(figures) < 2 for figures in back.values()):
        if time.monotonic() > ready_s + 60.0:
            raise SystemExit(f"not back within a minute: {back}")
        for name, client in clients.items():
            figures = client.ask()
            if figures["connections"] > known[name]["connections"]:
                back[name].setdefault("back s", round(time.monotonic() - ready_s, 2))
            if figures["received"] > known[name]["received"]:
                back[name].setdefault("first frame s", round(time.monotonic() - ready_s, 2))
    return back


def check(rows: dict[str, dict], closed: dict[str, tuple[str, int]]) -> bool:
    """Print the table; whether every limit is met."""
    headings = list(next(iter(rows.values())))
    print(f"\n| client | {' | '.join(headings)} |\n|---|{'---|' * len(headings)}")
    good = True
    for name, row in rows.items():
        kept = {
            "nothing lost": row["lost"] == 0,
            "fresh": row["age p99 ms"] < 1e3 * AGE_LIMIT_S,
            "no garbage": row["garbage"] in (0, "-"),
            "no backlog": row["backlog shown"] == 0,
            "back in time": row["back s"] < BACK_LIMIT_S,
            "no leak": row["threads more"] <= 0 and row["files more"] <= 0,
            "clean end": closed[name] == ("closed", 0),
        }
        broken = [what for what, met in kept.items() if not met]
        good &= not broken
        print(f"| {name} | {' | '.join(map(str, row.values()))} | {'NOT MET: ' + ', '.join(broken) if broken else ''}")
    return good


def connected(stack: ExitStack, name: str, command: list[str], addresses: dict[str, str]) -> LiveClient:
    """A client that receives."""
    client = LiveClient.start(command, addresses["web" if name == "javascript" else "hands"])
    stack.callback(client.kill)
    client.ask_until(lambda f: f["received"] > 0, 60.0)
    return client


def restarts(clients: dict[str, LiveClient], process: subprocess.Popen, start: Callable) -> dict[str, dict]:
    """Kill the server and `start` it again, twice: how soon clients are back, and what the second time leaked."""
    rows: dict[str, dict] = {}
    for _ in range(2):
        known = {name: client.ask() for name, client in clients.items()}
        before = {name: footprint(client.process.pid) for name, client in clients.items()}
        process.kill()
        process.wait()
        process = start()
        rows = comeback(clients, time.monotonic(), known)
        for name, client in clients.items():
            after = footprint(client.process.pid)
            rows[name]["threads more"] = after["Threads"] - before[name]["Threads"]
            rows[name]["files more"] = after["files"] - before[name]["files"]
    return rows


def run(take: Path, meshes: list[str], seconds: float) -> bool:
    """All of it; whether every limit is met."""
    options = [word for mesh in meshes for word in ("--mesh", mesh)]
    rows: dict[str, dict] = {}
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        commands = {name: build(name, folder) for name in NAMES}
        process, addresses = stack.enter_context(server(options, {}))
        player = Path(__file__).with_name("play_take.py")
        stack.enter_context(running(sys.executable, str(player), str(take), addresses["bodies"]))
        observer = Observer(addresses["hands"])
        for name, command in commands.items():
            client = connected(stack, name, command, addresses)
            rows[name] = read(client, observer, seconds) | stall(client, observer)
            print(f"{name}: {rows[name]}, load {os.getloadavg()[0]:.1f}", flush=True)
            client.close()
        clients = {name: connected(stack, name, command, addresses) for name, command in commands.items()}
        ports = {name: address.rpartition(":")[2] for name, address in addresses.items()}
        back = restarts(clients, process, lambda: stack.enter_context(server(options, ports))[0])
        return check(
            {name: rows[name] | back[name] for name in rows}, {name: client.close() for name, client in clients.items()}
        )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--take", type=Path, default=DEMO)
    parser.add_argument("--mesh", action="append", default=[], metavar="NAME=FILE")
    options = parser.parse_args()
    meshes = options.mesh or [f"{name}={LIBRARY_FOLDER / name}.ply" for name in DEMO_OBJECTS]
    return 0 if run(options.take, meshes, options.seconds) else 1


if __name__ == "__main__":
    sys.exit(main())
