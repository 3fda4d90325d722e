"""Options of the verbs that work with takes and servers.

They are apart from the verbs, whose libraries take a second to load, so that `--help` is quick. The method `check` of
each raises `ConfigError` or `BundleError` for values that cannot be used, also without loading a library.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from manipnet.common.options import ConfigError
from manipnet.config.files import require_file, require_hand
from manipnet.config.settings import CONTROL_PORT, control_endpoint
from manipnet.synthesis.model.providers import DEFAULT_MODEL, MAX_LOOK_AHEAD_S
from manipnet.synthesis.model.shipped import find_bundle
from manipnet_tools.commands.arguments import Positional, UseAppendAction, arg
from manipnet_tools.commands.checks import (
    already_exists,
    require_look_ahead,
    require_meshes,
    require_new,
    require_suffix,
    require_take,
)

SPEEDS: Final = (0.01, 100.0)
DEFAULT_SERVER: Final = f"127.0.0.1:{CONTROL_PORT}"
_GLTF: Final = "export gltf, which Blender opens and saves as {}"
OTHER_FORMATS: Final = {
    "fbx": _GLTF.format("FBX"),
    "usd": _GLTF.format("USD"),
    "obj": _GLTF.format("OBJ"),
    "abc": _GLTF.format("Alembic"),
    "glb": "gltf writes a .glb file",
    "vrm": "give --format gltf and --hand AVATAR.vrm; the file keeps what is VRM in it, and may be renamed to .vrm",
    "npz": "`manipnet synthesize` writes it",
}
"""What to do instead, by a format that is not written here."""
RIG_SUFFIXES: Final = (".glb", ".vrm", ".bvh")
"""Files of avatars, whose hands can be imported."""
EXPORT_SUFFIXES: Final = {"gltf": (".glb", ".gltf"), "csv": (".csv",)}


def _optional(metavar: str) -> Any:
    """An argument whose default None is not shown, because its help says what happens without it."""
    return arg(metavar=metavar, help_behavior_hint="")


@dataclass(frozen=True, kw_only=True)
class ServerOptions:
    """The running server that a verb talks to."""

    server: Annotated[str, arg(metavar="HOST[:PORT]")] = DEFAULT_SERVER
    """The control port of the server, which tells its other addresses."""
    keys: Annotated[Path | None, _optional("FILE")] = None
    """Your key file, for a server that requires keys (`manipnet keys make NAME`)."""

    def check_server(self) -> None:
        """Raise `ConfigError` for a malformed address or a key file that cannot be opened."""
        control_endpoint(self.server)
        require_file(self.keys)


@dataclass(frozen=True, kw_only=True)
class WritingOptions:
    """A verb that writes files."""

    force: bool = False
    """Replace what exists already."""


@dataclass(frozen=True)
class ReplayOptions(ServerOptions):
    """Stream a take to a running server, as a tracker would."""

    take: Annotated[Positional[Path], arg(metavar="TAKE")]
    """The take: a folder of BVH files, a trajectory text, a Motive CSV or a recording."""
    to: Annotated[str | None, _optional("tcp://HOST:PORT|osc://HOST:PORT")] = None
    """Send it to this address instead of asking the server for its own: ZeroMQ (tcp://) or OSC (osc://)."""
    speed: Annotated[float, arg(metavar="TIMES")] = 1.0
    """Play this many times as fast. The time stamps remain those of the take."""
    loop: bool = False
    """Repeat until stopped; the time stamps keep rising."""
    rate: Annotated[float | None, _optional("HZ")] = None
    """Resample to this rate; by default the take keeps its own."""
    up: Literal["y", "z"] = "y"
    """The axis that points up in a Motive CSV or a recording; the file does not say which."""

    def check(self) -> None:
        require_take(self.take)
        self.check_server()
        if not SPEEDS[0] <= self.speed <= SPEEDS[1]:
            raise ConfigError(f"--speed is {self.speed:g}; allowed are {SPEEDS[0]:g} to {SPEEDS[1]:g}")


@dataclass(frozen=True)
class RecordOptions(ServerOptions, WritingOptions):
    """Record until Ctrl-C, or for --seconds.

    Beside a running server: its hands and, at 60 Hz, the bodies from which they were synthesised.

    Without a server (--bodies-port): the bodies that a tracker sends to this machine, at the tracker's rate.

    If nothing arrives, no file is written and the exit status is 1.
    """

    out: Annotated[Path, arg(metavar="FILE")]
    """The file to write, .mcap."""
    bodies_port: Annotated[int | None, _optional("PORT")] = None
    """Record without a server: listen on this port for senders of bodies over ZeroMQ."""
    actor: Annotated[str | None, _optional("NAME")] = None
    """The actor whose bodies are recorded, if there are several; by default the first one heard."""
    rig: Annotated[Path | None, _optional("FILE")] = None
    """The server's rig file; the recording keeps it and its meshes."""
    seconds: Annotated[float | None, _optional("SECONDS")] = None
    """Stop after this time."""

    def check(self) -> None:
        require_suffix(self.out, ".mcap")
        require_new(self.out, self.force)
        require_file(self.rig)
        self.check_server()


@dataclass(frozen=True)
class RecoverOptions(WritingOptions):
    """Repair a recording that has no end, for example after a crash or a power cut. The file itself is not changed."""

    recording: Annotated[Positional[Path], arg(metavar="RECORDING")]
    """The recording to read."""
    out: Annotated[Path, arg(metavar="FILE")]
    """The file to write, .mcap."""

    def check(self) -> None:
        require_file(self.recording)
        require_suffix(self.out, ".mcap")
        require_new(self.out, self.force)
        if self.out.exists() and self.out.samefile(self.recording):
            raise ConfigError(f"--out {self.out}: is the recording itself, which is not changed; give another name")


@dataclass(frozen=True)
class SynthesizeOptions(WritingOptions):
    """Write the fingers of both hands of a take to a file, in world coordinates at 60 Hz."""

    take: Annotated[Positional[Path], arg(metavar="TAKE")]
    """The take: a folder of BVH files, a trajectory text, a Motive CSV or a recording."""
    out: Annotated[Path, arg(metavar="FILE")]
    """The file to write, .npz."""
    mesh: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME=FILE")] = ()
    """An object and its mesh, a file in metres or a name of the library; by default the recording's or the rig's."""
    model: Annotated[str, arg(metavar="NAME")] = DEFAULT_MODEL
    """The model: the name of a shipped bundle, or a bundle's folder."""
    look_ahead: Annotated[float, arg(metavar="SECONDS")] = MAX_LOOK_AHEAD_S
    """How much of the future the synthesis reads from the take, 0 to 0.5; it forecasts the rest."""
    rig: Annotated[Path | None, _optional("FILE")] = None
    """The rig file that says which body is which; recordings made beside a server, or with --rig, need none."""
    actor: Annotated[str | None, _optional("NAME")] = None
    """The actor, if the rig has several; by default the first."""
    hand: Annotated[Path | None, _optional("HAND.json")] = None
    """Also write the hands of this avatar, or of a shipped one (generic, adult, child); by default the rig's."""
    up: Literal["y", "z"] = "y"
    """The axis that points up in a Motive CSV or a recording; the file does not say which."""

    def check(self) -> None:
        require_take(self.take)
        require_suffix(self.out, ".npz")
        require_new(self.out, self.force)
        require_meshes(self.mesh)
        find_bundle(self.model)
        require_look_ahead(self.look_ahead)
        require_file(self.rig)
        require_hand(self.hand)


@dataclass(frozen=True)
class BatchOptions:
    """Write the fingers of every take in a folder, as `manipnet synthesize` does for one take.

    Results that are up to date are skipped, so a batch that was stopped continues where it was. A take that fails is
    reported and does not stop the others.
    """

    folder: Annotated[Positional[Path], arg(metavar="FOLDER")]
    """The folder to search for takes, at any depth: folders of BVH files, trajectory texts, Motive CSVs, recordings."""
    out: Annotated[Path, arg(metavar="DIR")]
    """The folder for the results: one .npz per take, and summary.json."""
    mesh: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME=FILE")] = ()
    """An object and its mesh, a file in metres or a name of the library; by default the recording's or the rig's."""
    model: Annotated[str, arg(metavar="NAME")] = DEFAULT_MODEL
    """The model: the name of a shipped bundle, or a bundle's folder."""
    look_ahead: Annotated[float, arg(metavar="SECONDS")] = MAX_LOOK_AHEAD_S
    """How much of the future the synthesis reads from the take, 0 to 0.5; it forecasts the rest."""
    rig: Annotated[Path | None, _optional("FILE")] = None
    """The rig file that says which body is which; recordings made beside a server, or with --rig, need none."""
    actor: Annotated[str | None, _optional("NAME")] = None
    """The actor, if the rig has several; by default the first."""
    hand: Annotated[Path | None, _optional("HAND.json")] = None
    """Also write the hands of this avatar, or of a shipped one (generic, adult, child); by default the rig's."""
    up: Literal["y", "z"] = "y"
    """The axis that points up in a Motive CSV or a recording; the file does not say which."""
    jobs: Annotated[int | None, _optional("N")] = None
    """Number of takes at the same time on this machine; by default one per processor."""
    ray: Annotated[str | None, _optional("ADDRESS")] = None
    """Work on a Ray cluster instead: HOST:PORT, auto for the one on this machine, or local to start one here."""

    def check(self) -> None:
        if not self.folder.is_dir():
            raise ConfigError(f"{self.folder}: is not a folder; use `manipnet synthesize` for a single take")
        require_meshes(self.mesh)
        find_bundle(self.model)
        require_look_ahead(self.look_ahead)
        require_file(self.rig)
        require_hand(self.hand)
        if self.jobs is not None and self.jobs < 1:
            raise ConfigError(f"--jobs is {self.jobs}; it must be at least 1")


@dataclass(frozen=True)
class ExportOptions(WritingOptions):
    """Write hands and objects for other programs.

    bvh: a folder with one file per hand and object, the ManipNet dataset's skeleton. gltf: one file with skinned hands,
    objects and their animation. csv: one table.
    """

    source: Annotated[Positional[Path], arg(metavar="RECORDING|NPZ|TAKE")]
    """A recording with hands, a file of `manipnet synthesize`, or a captured take (folder of BVH files)."""
    format: Annotated[Literal["bvh", "gltf", "csv"], arg(instead=OTHER_FORMATS)]
    """The format to write."""
    out: Annotated[Path, arg(metavar="PATH")]
    """The file to write (.glb, .gltf or .csv), or for bvh the folder."""
    mesh: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME=FILE")] = ()
    """gltf: the mesh of an object in metres, a file or an object of the library, if the source does not hold it."""
    actor: Annotated[str | None, _optional("NAME")] = None
    """The actor whose hands to write, if a recording has several; by default the first."""
    hand: Annotated[Path | None, _optional("HAND|AVATAR")] = None
    """Write these hands, with contact solved on them: a profile (HAND.json, generic, adult, child), or an avatar (.glb,
    .vrm, .bvh), whose own mesh and bones are then written in gltf and bvh."""
    map: Annotated[Path | None, _optional("FILE")] = None
    """The bone map of an avatar, as for `manipnet hand import`."""
    right_handed: bool = False
    """bvh: write right-handed centimetres, for Blender and Maya, instead of the dataset's left-handed decimetres."""

    def check(self) -> None:
        if not self.source.is_dir():
            require_file(self.source)
        require_meshes(self.mesh)
        suffixes = EXPORT_SUFFIXES.get(self.format, ())
        if suffixes and self.out.suffix.lower() not in suffixes:
            raise ConfigError(f"--out {self.out}: for --format {self.format} it must end in {' or '.join(suffixes)}")
        if self.format == "bvh" and any(self.out.glob("*.bvh")) and not self.force:
            raise ConfigError(already_exists(f"--out {self.out}: a take in BVH files"))
        require_new(self.out, self.force or self.format == "bvh")
        require_hand(self.hand)
        require_file(self.map)
        if self.format == "gltf" and self.hand is not None and self.hand.suffix.lower() == ".bvh":
            raise ConfigError(f"--hand {self.hand}: has no mesh for --format gltf; use bvh, or give the avatar as .glb")
        if self.map is not None and (self.hand is None or self.hand.suffix.lower() not in RIG_SUFFIXES):
            raise ConfigError("--map is for an avatar that --hand names; a profile needs no map")
        if self.right_handed and self.format != "bvh":
            raise ConfigError(f"--right-handed is for --format bvh only; {self.format} is always right-handed")


@dataclass(frozen=True)
class CalibrateOptions(ServerOptions):
    """Find where the wrists sit on their tracked bodies, and the size of the hands; see docs/calibration.md.

    Lay both hands flat on the sheet, wrists on the marks and fingers along the lines, and keep still until it is done.
    """

    actor: Annotated[str | None, _optional("NAME")] = None
    """The actor to calibrate, if there are several."""
    hand: Literal["both", "left", "right"] = "both"
    """The hand that lies on the sheet."""
    hand_length: Annotated[float | None, _optional("METRES")] = None
    """Length from the middle of the wrist to the tip of the middle finger, read off the sheet's ruler."""
    fingertips: bool = False
    """Measure the hand length: the hands are drawn back until the middle fingertips touch the sheet's centre line."""
    at: Annotated[tuple[float, float, float], arg(metavar="X Y Z")] = (0.0, 0.0, 0.0)
    """The sheet's centre in the world, metres; Y is the height of the table."""
    yaw: Annotated[float, arg(metavar="DEGREES")] = 0.0
    """Rotation of the sheet about the vertical, counter-clockwise as seen from above."""
    reference: Annotated[str | None, _optional("NAME")] = None
    """Instead of --at: a prop of the rig that stands on the sheet's centre with its x axis to the operator's right."""
    countdown: Annotated[int, arg(metavar="SECONDS")] = 5
    """Time to lay down the hands."""
    seconds: Annotated[float, arg(metavar="SECONDS")] = 2.0
    """How long the hands must lie still."""
    dry_run: bool = False
    """Do not change the rig file; the calibration lasts until the server stops."""

    def check(self) -> None:
        self.check_server()
