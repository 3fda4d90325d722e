"""Describes the machine of a measurement and its load, without which absolute times mean nothing."""

import os
import platform
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import onnxruntime


@dataclass(frozen=True)
class Machine:
    """A machine at the moment of a measurement."""

    processor: str
    cores: int
    system: str
    python: str
    onnxruntime: str
    busy: float | None
    """Mean number of processes that wanted a core in the minute before; None if the system does not report it."""
    date: str

    def __str__(self) -> str:
        load = "" if self.busy is None else f", load {self.busy:.1f} before"
        return f"{self.processor}, {self.cores} cores{load}; {self.system}, Python {self.python}; {self.date}"


def this_machine() -> Machine:
    """This machine, now."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return Machine(
        _processor(),
        os.cpu_count() or 1,
        f"{platform.system()} {platform.machine()}",
        platform.python_version(),
        onnxruntime.__version__,
        load,
        datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    )


def resident_mb(process_id: int) -> float | None:
    """Resident memory of a process in MB; None on a system without /proc."""
    try:
        status = Path(f"/proc/{process_id}/status").read_text(encoding="ascii")
    except OSError:
        return None
    lines = dict(line.split(":", 1) for line in status.splitlines() if ":" in line)
    return int(lines["VmRSS"].split()[0]) * 1024 / 1e6


def _processor() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in text.splitlines() if line.startswith("model name")]
    return names[0] if names else platform.machine()
