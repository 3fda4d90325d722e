"""What a generated set holds: hours, grasps by kind and by kind of shape, and how long they took."""

from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from manipnet_tools.takes.dataset import take_folders
from manipnet_tools.takes.take_file import read_take_file


def statistics(folder: Path) -> dict[str, Any]:
    """The statistics of the takes in a folder."""
    counts: dict[str, Counter[str]] = {name: Counter() for name in ("tried", "found", "verified", "refused")}
    shapes: dict[str, list[float]] = defaultdict(lambda: [0.0, 0.0, 0.0])
    events, smoothness = Counter[str](), []
    frames = bytes_ = 0
    rate_hz, cpu_s, grasps_s = 120.0, 0.0, 0.0
    for path in take_folders(folder):
        take, _ = read_take_file(path)
        notes = take.notes
        frames, rate_hz = frames + len(take.object), take.rate_hz
        bytes_ += sum(file.stat().st_size for file in path.iterdir())
        for name, counter in counts.items():
            counter.update(notes["grasps"][name])
        shape = shapes[notes["shape"]]
        shape[0] += 1
        shape[1] += sum(notes["grasps"]["verified"].values())
        shape[2] += notes["grasps_cpu_s"]
        events.update(event["event"] for event in notes["events"])
        smoothness += list(notes["smoothness_cm_s2"].values())
        cpu_s, grasps_s = cpu_s + notes["cpu_s"], grasps_s + notes["grasps_cpu_s"]
    verified = sum(counts["verified"].values())
    return {
        "hours": round(frames / rate_hz / 3600.0, 3),
        "takes": int(sum(shape[0] for shape in shapes.values())),
        "megabytes": round(bytes_ / 1e6, 1),
        "cpu_hours": round(cpu_s / 3600.0, 3),
        "verified_per_cpu_hour": round(3600.0 * verified / max(grasps_s, 1e-9)),
        "smoothness_cm_s2": round(sum(smoothness) / max(len(smoothness), 1), 1),
        "events": dict(sorted(events.items())),
        "grasps": {name: dict(sorted(counter.items())) for name, counter in counts.items()},
        "shapes": {
            kind: {"takes": int(n), "verified": int(v), "verified_per_cpu_hour": round(3600.0 * v / max(s, 1e-9))}
            for kind, (n, v, s) in sorted(shapes.items())
        },
    }


def print_statistics(found: dict[str, Any], console: Console) -> None:
    """Print the most important ones."""
    grasps = Table(title="grasps")
    for column in ("kind", "tried", "carry by geometry", "hold in the simulator"):
        grasps.add_column(column, justify="left" if column == "kind" else "right")
    for kind, tried in found["grasps"]["tried"].items():
        grasps.add_row(kind, str(tried), *(str(found["grasps"][name].get(kind, 0)) for name in ("found", "verified")))
    console.print(grasps)
    console.print(
        f"{found['takes']} takes, {found['hours']} h of two hands, {found['megabytes']} MB; "
        f"{found['verified_per_cpu_hour']} verified grasps per processor hour"
    )
