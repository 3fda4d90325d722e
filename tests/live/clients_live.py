"""A minute with every engine-free client: losses, age, memory, restarts, a client that stalls.

`python tests/live/clients_live.py [--seconds 60] [--only csharp] [--serve "manipnet-serve --mesh mug1=mug1.obj"
[--take TAKE]]`. Without `--serve` a small publisher of hands stands in for the server. With it, the given command is
started on free ports, a take is replayed into it if one is given, and it is killed and started again on the same ports.
Prints a line of figures per client and fails on a limit.

`transit` is what a frame took from the server's publishing to the client's reader; JavaScript has another clock, so
there `age`, the time since the newest frame arrived, stands in, which a frame's length, 17 ms, is part of.
"""

import argparse
import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "tests" / "clients"), str(ROOT / "clients" / "python")]
from languages import NAMES, LiveClient, build  # noqa: E402
from manipnet_client import Client  # noqa: E402

TRANSIT_LIMIT_MS, AGE_LIMIT_MS, BACK_LIMIT_S = 20.0, 37.0, 2.0
STALL_S = 5.0


@dataclass(frozen=True)
class Stage:
    """What to read from: a server's command, or None for the stand-in, and a take to replay into it."""

    serve: str | None
    take: str | None

    @contextmanager
    def server(self, ports: tuple[str, str] = ("0", "0")) -> Iterator[tuple[subprocess.Popen, str, str]]:
        """A running server: its process, tcp:// and ws:// address."""
        if self.serve is None:
            words = [sys.executable, str(ROOT / "tests" / "clients" / "publisher.py")]
            words += ["--port", ports[0], "--websocket-port", ports[1], "--session", str(time.monotonic_ns())]
        else:
            others = ["--input-port", "0", "--control-port", "0", "--osc-port", "0", "--page-port", "0"]
            words = [*shlex.split(self.serve), "--port", ports[0], "--web-port", ports[1], *others]
        with ExitStack() as started:
            process = started.enter_context(_running(words))
            assert process.stdout is not None
            line = next((line for line in process.stdout if line.startswith("ready")), None)
            if line is None:
                raise SystemExit(f"{shlex.join(words)} ended without being ready")
            threading.Thread(target=process.stdout.read, daemon=True).start()  # it goes on telling
            tcp = re.findall(r"tcp://\S+", line)[0]
            if self.take is not None:
                bodies = dict(re.findall(r"(\w+) (tcp://\S+)", line))["bodies"]
                started.enter_context(_running(["manipnet", "replay", self.take, "--to", bodies, "--loop"]))
            yield process, tcp, re.findall(r"ws://\S+", line)[0]


@contextmanager
def _running(words: list[str]) -> Iterator[subprocess.Popen]:
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def footprint(pid: int) -> dict[str, int]:
    """Resident kilobytes, threads and open files of a process."""
    status = Path(f"/proc/{pid}/status").read_text()
    found = {key: int(re.search(rf"{key}:\s+(\d+)", status)[1]) for key in ("VmRSS", "Threads")}  # type: ignore[index]
    return {**found, "files": len(os.listdir(f"/proc/{pid}/fd"))}


def read_steadily(client: LiveClient, seconds: float) -> dict:
    """Ask 50 times a second; the last figures, with 99th percentiles and what was allocated."""
    client.ask_until(lambda f: f["received"] > 60)
    first, ages, transits, allocated = client.ask(), [], [], 0
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        figures = client.ask()
        ages.append(figures["age_s"])
        transits.append(figures.get("transit_s", 0.0))
        allocated += figures.get("allocations", 0)
        time.sleep(0.02)
    last = client.ask()
    return {
        "frames": last["received"] - first["received"],
        "lost": last["lost"],
        "late": last["late"],
        "age_p99_ms": _p99_ms(ages),
        "transit_p99_ms": _p99_ms(transits),
        "collections": last.get("collections"),
        "allocations": allocated if "allocations" in last else None,
    }


def _p99_ms(seconds: list[float]) -> float:
    return round(1000 * sorted(seconds)[int(0.99 * len(seconds))], 1)


def restart(client: LiveClient, stage: Stage, old: subprocess.Popen, tcp: str, websocket: str) -> dict:
    """Kill the server and start it again, twice: how soon the client is connected, and what the second time leaked."""
    ports = (tcp.rpartition(":")[2], websocket.rpartition(":")[2])
    back_s, before, after = 0.0, {}, {}
    with ExitStack() as servers:
        for _ in range(2):
            before, known = footprint(client.process.pid), client.ask()
            old.kill()
            old.wait()
            old, _, _ = servers.enter_context(stage.server(ports))
            ready = time.monotonic()
            client.ask_until(lambda f, known=known: f["connections"] > known["connections"])
            back_s = max(back_s, time.monotonic() - ready)
            client.ask_until(lambda f, known=known: f["session"] != known["session"])
            after = footprint(client.process.pid)
    return {"back_s": round(back_s, 2), "leaked": {key: after[key] - before[key] for key in before}}


def stall(client: LiveClient, tcp: str) -> dict:
    """Stop the client for five seconds: what it shows when it goes on must be new."""
    with Client(tcp) as other:
        held = client.ask()["shown_seq"]
        os.kill(client.process.pid, signal.SIGSTOP)
        time.sleep(STALL_S)
        newest = other.wait()
        os.kill(client.process.pid, signal.SIGCONT)
        assert newest is not None
        seen, resumed = [], time.monotonic()
        while not seen or seen[-1] < newest.seq - 5:
            seen.append(client.ask()["shown_seq"])
        resumed_s = time.monotonic() - resumed
    backlog = [s for s in seen if held + 20 < s < newest.seq - 20]
    return {"missed": newest.seq - held, "backlog_shown": len(backlog), "resumed_s": round(resumed_s, 2)}


def check(name: str, command: list[str], stage: Stage, seconds: float) -> bool:
    """All of it with one client; prints the figures and tells whether every limit is met."""
    with stage.server() as (process, tcp, websocket):
        client = LiveClient.start(command, websocket if name == "javascript" else tcp)
        try:
            figures = (
                read_steadily(client, seconds) | stall(client, tcp) | restart(client, stage, process, tcp, websocket)
            )
            closed = client.close()
        finally:
            client.kill()
    kept = {
        "nothing lost": figures["lost"] == 0,
        "fresh": figures["transit_p99_ms"] <= TRANSIT_LIMIT_MS and figures["age_p99_ms"] <= AGE_LIMIT_MS,
        "no garbage": not figures["collections"] and not figures["allocations"],
        "no backlog": figures["backlog_shown"] == 0,
        "back in time": figures["back_s"] < BACK_LIMIT_S,
        "no leak": figures["leaked"]["Threads"] <= 0 and figures["leaked"]["files"] <= 0,
        "clean end": closed == ("closed", 0),
    }
    broken = [what for what, met in kept.items() if not met]
    print(f"{name}: {figures} {'NOT MET: ' + ', '.join(broken) if broken else 'all met'}", flush=True)
    return not broken


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--serve", help="command that starts a server; ports are appended")
    parser.add_argument("--take", help="what to replay into it, at its own rate, over and over")
    parser.add_argument("--only", choices=NAMES)
    options = parser.parse_args()
    stage = Stage(options.serve, options.take)
    names = [options.only] if options.only else NAMES
    with tempfile.TemporaryDirectory() as folder:
        met = [check(name, build(name, Path(folder)), stage, options.seconds) for name in names]
    return 0 if all(met) else 1


if __name__ == "__main__":
    sys.exit(main())
