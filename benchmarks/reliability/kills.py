"""Server, sender and client killed (SIGKILL) at random for ten minutes, and started again at once.

The ports stay the same. A killed one counts as back when the client shows live hands again. Times are counted from
where the restarted process can act: a server from its `ready` line, sender and client from when they are loaded.
"""

import queue
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from live_server import LiveServer

from .motion import motion, recording
from .roles import start
from .row import Row, parser, report

RATE_HZ, BACK_S = 120.0, 1.0
CALM_S = (1.0, 5.0)
PATIENCE_S = 60.0
PORTS = {"hands": "port", "bodies": "input-port", "control": "control-port", "osc": "osc-port", "web": "web-port"}
VICTIMS = ("server", "sender", "client")


@dataclass(frozen=True)
class Kill:
    """Seconds from the kill to the new process ready; and from there to connected, and to live hands."""

    victim: str
    restart_s: float
    connected_s: float
    live_s: float


class Role:
    """A process of `roles` and what it says."""

    def __init__(self, role: str, address: str, *more: str) -> None:
        self._arguments = role, address, *more
        self.process, self.lines = self._start()

    def restart(self) -> None:
        self.process.kill()
        self.process.wait()
        self.process, self.lines = self._start()

    def wait_for(self, word: str, after_s: float = 0.0) -> float:
        """When it said `word`, after `after_s`."""
        give_up_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < give_up_s:
            at_s, said, *_ = self.lines.get(timeout=PATIENCE_S)
            if said == word and float(at_s) >= after_s:
                return float(at_s)
        raise TimeoutError(f"{self._arguments[0]}: no {word!r}")

    def _start(self) -> tuple[subprocess.Popen[str], "queue.Queue[list[str]]"]:
        process, lines = start(*self._arguments), queue.Queue()
        threading.Thread(target=_forward, args=(process.stdout, lines), daemon=True).start()
        return process, lines


@dataclass
class Chaos:
    """A server on ports of its own choice that keep, with its sender and client."""

    options: list[str]
    recording: Path
    sessions: list[str] = field(default_factory=list)
    stuck: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        server = LiveServer(*self.options).wait_ready()
        ports = {what: address.rpartition(":")[2] for what, address in server.addresses.items()}
        names = {
            "hands": "port",
            "bodies": "input-port",
            "control": "control-port",
            "osc": "osc-port",
            "web": "web-port",
        }
        self.options += [f"--{option}={ports[what]}" for what, option in names.items() if what in ports]
        self.server = server
        self.sender = Role("perform", server.addresses["bodies"], str(self.recording))
        self.client = Role("look", server.addresses["hands"])
        self.client.wait_for("live")
        self._note_session()

    def close(self) -> None:
        for role in (self.sender, self.client):
            role.process.kill()
        self.server.stop()

    def kill(self, victim: str) -> Kill:
        """Kill it, start it anew, wait for live hands."""
        killed_s = time.monotonic()
        if victim == "server":
            ready_s = self._restart_server()
            connected_s = self.client.wait_for("connected", killed_s)
        else:
            role = {"sender": self.sender, "client": self.client}[victim]
            role.restart()
            ready_s = role.wait_for("loaded")
            connected_s = role.wait_for("connected")
        live_s = self.client.wait_for("live", connected_s)
        return Kill(victim, ready_s - killed_s, connected_s - ready_s, live_s - ready_s)

    def _restart_server(self) -> float:
        self.server.stop(signal.SIGKILL)
        while True:
            self.server = LiveServer(*self.options)
            try:
                self.server.wait_ready()
                break
            except AssertionError as error:  # it ended: an address is taken, or worse
                self.stuck.append(str(error))
                self.server.stop()
        ready_s = time.monotonic()
        self._note_session()
        return ready_s

    def _note_session(self) -> None:
        self.sessions.append(self.server.ask({"op": "hello"})["session"])


def _forward(stream, lines: "queue.Queue[list[str]]") -> None:
    with stream:
        for line in stream:
            lines.put(line.split())


def main() -> None:
    arguments = parser(__doc__, 600.0).parse_args()
    rng = random.Random(arguments.seed)
    performance = motion(RATE_HZ)
    kills: list[Kill] = []
    with tempfile.TemporaryDirectory() as folder:
        meshes = [f"--mesh={name}={path}" for name, path in performance.meshes.items()]
        chaos = Chaos(meshes, recording(performance, Path(folder)))
        try:
            end_s = time.monotonic() + arguments.seconds
            while time.monotonic() < end_s:
                time.sleep(rng.uniform(*CALM_S))
                kills.append(chaos.kill(rng.choice(VICTIMS)))
                print(kills[-1], file=sys.stderr, flush=True)
        finally:
            chaos.close()
    killed = {victim: [kill for kill in kills if kill.victim == victim] for victim in VICTIMS}
    rows = [_row(victim, of_victim) for victim, of_victim in killed.items() if of_victim]
    starts = len(killed["server"]) + 1
    rows.append(
        Row(
            f"{len(kills)} kills in {arguments.seconds / 60:g} min",
            "no stuck port, session id changes",
            f"{len(chaos.stuck)} stuck ports; {len(set(chaos.sessions))} session ids of {starts} servers",
            not chaos.stuck and len(set(chaos.sessions)) == starts,
            {"stuck": chaos.stuck, "sessions": chaos.sessions},
        )
    )
    report("kills", rows, arguments.out)


def _row(victim: str, kills: list[Kill]) -> Row:
    restart, connected, live = (
        np.array([getattr(kill, name) for kill in kills]) for name in ("restart_s", "connected_s", "live_s")
    )
    return Row(
        f"{victim} killed {len(kills)} times",
        f"reconnect < {BACK_S:g} s",
        f"from ready: connected {_both(connected)}, live hands {_both(live)}; kill to ready {_both(restart)}",
        bool(connected.max() < BACK_S),
        {"restart_s": list(restart), "connected_s": list(connected), "live_s": list(live)},
    )


def _both(seconds: np.ndarray) -> str:
    return f"{np.median(seconds):.2f} s median, {seconds.max():.2f} s at most"


if __name__ == "__main__":
    main()
