"""Reads the rigid bodies and bones of a take that OptiTrack Motive exported as CSV.

The first line holds pairs of a key and a value, and a table follows (`motive_table`); before format 1.2 it was a list
of frames (`motive_frames`). An empty cell means that a body was lost in that frame. The time column is rounded to a
millisecond, so times are computed from the frame numbers.
Source: docs.optitrack.com, "Data Export: CSV", and files of the format versions 1.1 to 1.25.
"""

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from manipnet.geometry import Array
from manipnet.inputs.timecode_rate import TimecodeRate
from manipnet_tools.takes.motive_frames import read_frames
from manipnet_tools.takes.motive_table import Columns, MotiveCsvError, Table, read_table
from manipnet_tools.takes.text_file import read_text
from manipnet_tools.takes.timecode_track import TimecodeTrack

UNITS_M: Final = {"meters": 1.0, "centimeters": 0.01, "millimeters": 0.001}
EULER_ORDERS: Final = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
QUATERNION: Final = "XYZW"
UNTRACKED: Final = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
FIRST_WORDS: Final = ("comment", "info")
HANDEDNESS: Final = ("righthanded", "lefthanded")
"""How the list of frames of older versions begins."""
FARTHEST_M: Final = 1000.0
QUATERNION_LENGTHS: Final = (0.25, 4.0)
"""Poses beyond these are numbers that lost their decimal points."""
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class MotiveCsv:
    """Poses `(T, 7)` in metres and whether they were tracked `(T,)`, by body; `time_s (T,)` from the start.

    Rigid bodies come first, then bones, which are called `Skeleton:Bone`.
    """

    rate_hz: float
    time_s: Array
    bodies: dict[str, tuple[Array, NDArray[np.bool_]]]
    timecode: TimecodeTrack | None = None


def read_motive_csv(path: Path) -> MotiveCsv:
    """Read an export with rigid bodies or bones. Raises `MotiveCsvError`."""
    try:
        text = read_text(path)
        is_list = text.lstrip().lower().startswith(tuple(f"{word}," for word in FIRST_WORDS) + HANDEDNESS)
        return _motive_csv(read_frames(text) if is_list else read_table(text, str(path)), str(path))
    except OSError as error:
        raise MotiveCsvError(f"{path}: cannot be read ({error})") from None
    except MotiveCsvError as error:
        raise MotiveCsvError(f"{path}: {error}") from None


def _motive_csv(table: Table, where: str) -> MotiveCsv:
    options = table.options
    scale = _unit(options)
    rotation = options.get("Rotation Type", "Quaternion")
    if options.get("Coordinate Space", "Global") != "Global":
        raise MotiveCsvError(f"Coordinate Space is {options['Coordinate Space']}; export it as Global")
    step_s = _frame_step(table)
    numbers = table.frames
    bodies = {name: _track(name, columns, table.values, scale, rotation) for name, columns in table.bodies.items()}
    rate_hz = 1.0 / (step_s * float(np.median(np.diff(numbers)))) if len(numbers) > 1 else 1.0 / step_s
    announced = options.get("Total Exported Frames", "")
    if announced.isdigit() and int(announced) != len(numbers):
        _log.warning("%s: announces %s frames but has %d, which are used", where, announced, len(numbers))
    return MotiveCsv(round(rate_hz, 3), (numbers - numbers[0]) * step_s, bodies, _timecode(table))


def _timecode(table: Table) -> TimecodeTrack | None:
    """The timecode of the frames. No cell states its rate, so the frame numbers tell it."""
    rate = TimecodeRate()
    return TimecodeTrack.of([(text, rate.note(text)) if text else (None, None) for text in table.timecodes])


def _unit(options: dict[str, str]) -> float:
    value = options.get("Length Units", "Meters")
    if value.lower() not in UNITS_M:
        raise MotiveCsvError(f"Length Units is {value!r}; allowed are {', '.join(UNITS_M)}")
    return UNITS_M[value.lower()]


def _frame_step(table: Table) -> float:
    """Seconds from one frame number to the next: by the rate of the export, or of the capture if the times say so."""
    keys = [key for key in ("Export Frame Rate", "Capture Frame Rate") if table.options.get(key)]
    steps_s = [1.0 / _rate(table.options[key], key) for key in keys]
    if not steps_s:
        raise MotiveCsvError("Export Frame Rate is missing from the first line; export the take again")
    times_s, frames = table.times_s[[0, -1]], table.frames[[0, -1]]
    if not np.isfinite(times_s).all() or np.ptp(times_s) < 0.1:
        return steps_s[0]
    measured_s = float((times_s[1] - times_s[0]) / (frames[1] - frames[0]))
    return min(steps_s, key=lambda step_s: abs(step_s - measured_s) > 0.05 * measured_s)


def _rate(text: str, key: str) -> float:
    try:
        rate_hz = float(text)
    except ValueError:
        rate_hz = 0.0
    if not 1.0 <= rate_hz <= 2000.0:
        raise MotiveCsvError(f"{key} is {text!r}; it must be 1 to 2000 Hz")
    return rate_hz


def _track(name: str, body: Columns, values: Array, scale: float, rotation: str) -> tuple[Array, NDArray[np.bool_]]:
    """Poses, and whether they were tracked; a lost body keeps its last pose, or has its first one before that."""
    positions = scale * values[:, [body.position[axis] for axis in "XYZ"]]
    if rotation in ("Quaternion", *EULER_ORDERS) and body.rotation.keys() == set(QUATERNION):
        quats = values[:, [body.rotation[axis] for axis in QUATERNION]]
        quats = np.where(np.linalg.norm(quats, axis=1, keepdims=True) > 1e-6, quats, np.nan)
    elif rotation in EULER_ORDERS and body.rotation.keys() == set("XYZ"):
        angles = values[:, [body.rotation[axis] for axis in rotation]]
        # Rotations are about the body's own axes, in the order of the name.
        quats = Rotation.from_euler(rotation, np.nan_to_num(angles), degrees=True).as_quat() + 0.0 * angles[:, :1]
    else:
        found = f"{'/'.join(body.rotation)} of the type {rotation}"
        raise MotiveCsvError(f"body {name!r} has rotations {found}; export Quaternion or XYZ")
    poses = np.concatenate([positions, quats], axis=1)
    tracked = np.asarray(np.isfinite(poses).all(axis=1))
    if not tracked.any():
        poses[:] = UNTRACKED
        return poses, tracked
    poses = poses[np.maximum.accumulate(np.where(tracked, np.arange(len(tracked)), np.argmax(tracked)))]
    _check_plausible(name, poses)
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    return poses, tracked


def _check_plausible(name: str, poses: Array) -> None:
    lengths, farthest_m = np.linalg.norm(poses[:, 3:], axis=1), float(np.abs(poses[:, :3]).max())
    shortest, longest = QUATERNION_LENGTHS
    if farthest_m > FARTHEST_M:
        found = f"positions up to {farthest_m:.3g} m"
    elif not (shortest <= lengths.min() and lengths.max() <= longest):
        found = f"quaternions of length {lengths.max() if lengths.max() > longest else lengths.min():.3g} instead of 1"
    else:
        return
    raise MotiveCsvError(
        f"body {name!r} has {found}: another program has saved the file without its decimal points, "
        "or it is not the export of a take; export it from Motive again"
    )
