"""How soon server, sender and client are back after they are killed (SIGKILL) at random and restarted at once.

The ports stay the same. A killed process is back when the client shows live hands again. Times count from the moment at
which the restarted process can act: for a server its line `ready`, for sender and client the end of their loading.
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

from benchmarks.support import LiveServer

from .motion import mesh_options, motion, recording
from .roles import start
from .row import Row, parser, report

RATE_HZ, BACK_S = 120.0, 1.0
CALM_S = (1.0, 5.0)
PATIENCE_S = 60.0
PORT_OPTIONS = {
    "hands": "port",
    "bodies": "input-port",
    "control": "control-port",
    "osc": "osc-port",
    "web": "web-port",
}
"""The option of each address in the server's line `ready`."""
VICTIMS = ("server", "sender", "client")


@dataclass(frozen=True)
class Kill:
    """Seconds from the kill until the new process is ready, and from then until connected and until live hands."""

    victim: str
    restart_s: float
    connected_s: float
    live_s: float


class Role:
    """A process of `roles` and the lines that it prints."""

    def __init__(self, role: str, address: str, *more: str) -> None:
        self._arguments = role, address, *more
        self.process, self.lines = self._start()

    def restart(self) -> None:
        self.process.kill()
        self.process.wait()
        self.process, self.lines = self._start()

    def wait_for(self, word: str, after_s: float = 0.0) -> float:
        """The time at which it printed `word`, at or after `after_s`."""
        give_up_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < give_up_s:
            at_s, printed, *_ = self.lines.get(timeout=PATIENCE_S)
            if printed == word and float(at_s) >= after_s:
                return float(at_s)
        raise TimeoutError(f"{self._arguments[0]} did not print {word!r} within {PATIENCE_S:g} s")

    def _start(self) -> tuple[subprocess.Popen[str], "queue.Queue[list[str]]"]:
        process, lines = start(*self._arguments), queue.Queue()
        threading.Thread(target=_forward, args=(process.stdout, lines), daemon=True).start()
        return process, lines


@dataclass
class Trio:
    """A server that keeps its ports, a sender and a client."""

    options: list[str]
    recording: Path
    sessions: list[str] = field(default_factory=list)
    stuck: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        server = LiveServer(*self.options).wait_ready()
        ports = {what: address.rpartition(":")[2] for what, address in server.addresses.items()}
        self.options += [f"--{option}={ports[what]}" for what, option in PORT_OPTIONS.items() if what in ports]
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
        """Kill a process, start it again and wait for live hands."""
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
            except AssertionError as error:  # it ended, for example because an address is still in use
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
    scenario = motion(RATE_HZ)
    kills: list[Kill] = []
    with tempfile.TemporaryDirectory() as folder:
        trio = Trio(mesh_options(scenario), recording(scenario, Path(folder)))
        try:
            end_s = time.monotonic() + arguments.seconds
            while time.monotonic() < end_s:
                time.sleep(rng.uniform(*CALM_S))
                kills.append(trio.kill(rng.choice(VICTIMS)))
                print(kills[-1], file=sys.stderr, flush=True)
        finally:
            trio.close()
    killed = {victim: [kill for kill in kills if kill.victim == victim] for victim in VICTIMS}
    rows = [_row(victim, of_victim) for victim, of_victim in killed.items() if of_victim]
    starts = len(killed["server"]) + 1
    rows.append(
        Row(
            f"{len(kills)} kills in {arguments.seconds / 60:g} min",
            "no stuck port, session id changes",
            f"{len(trio.stuck)} stuck ports; {len(set(trio.sessions))} session ids of {starts} servers",
            not trio.stuck and len(set(trio.sessions)) == starts,
            {"stuck": trio.stuck, "sessions": trio.sessions},
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
