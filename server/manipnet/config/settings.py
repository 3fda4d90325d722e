"""The configuration of a server: frozen values, and the options of which it is made."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

from manipnet import inputs, outputs
from manipnet.common.options import (
    Choice,
    ConfigError,
    Endpoint,
    Folder,
    Network,
    Networks,
    Number,
    Option,
    Port,
    Switch,
    Text,
    check_values,
    from_keys,
    option,
    options_of,
    parse_endpoint,
)
from manipnet.net.addresses import is_loopback
from manipnet.synthesis.ik.solvers import DEFAULT_SOLVER, SOLVERS
from manipnet.synthesis.model.providers import DEFAULT_MODEL, MAX_LOOK_AHEAD_S, PROVIDERS, Provider
from manipnet.synthesis.objects.library import library_file
from manipnet.synthesis.objects.units import UNITS_M

if TYPE_CHECKING:
    from manipnet.geometry import Array

BodyKey = int | str
"""Streaming id or name of a body, as its sender gives it."""

WRISTS: Final = ("left_wrist", "right_wrist")
MAX_ACTORS: Final = 16
MAX_OBJECTS: Final = 32
SCALE_RANGE: Final = (0.2, 5.0)
"""Allowed scale factors of a hand."""

CONTROL_PORT: Final = 5557
TRIGGER_PORT: Final = 1512
"""Where Motive sends its remote trigger: its command port plus 2."""

TRACKED: Final = "what is tracked"
SYNTHESIS: Final = "how the fingers are synthesised"
SERVER: Final = "where the server listens, and who may connect"
FILES: Final = "files and log"
"""Headings of the options in `--help`."""

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class BodyConfig:
    """A tracked body, and where the wrist or prop sits on it: `offset (7,)` is the pose T_body_thing, or None."""

    key: BodyKey
    offset: "Array | None" = None


@dataclass(frozen=True, slots=True)
class ObjectConfig:
    """A prop: the body that carries it, its mesh file, and the name by which clients know it."""

    name: str
    body: BodyConfig
    mesh: Path
    unit: str = "m"
    scale: float = 1.0


@dataclass(frozen=True, slots=True)
class ActorConfig:
    """One pair of hands and the props it may hold. `hand_scale` is the size of the hands relative to the model's."""

    name: str
    wrists: dict[str, BodyConfig]
    """The bodies of one wrist or both, by the names in `WRISTS`."""
    objects: tuple[ObjectConfig, ...] = ()
    hand_scale: float = 1.0
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Lower and upper limit, in radians, of some of `wire.hand_names.ANGLE_NAMES`; they narrow the model's limits."""

    hand: Path | None = None
    """The profile of an avatar's hand, on which the actor is solved too."""

    def bodies(self) -> dict[str, BodyConfig]:
        """The body of each wrist and prop, by the name of the wrist or prop."""
        return {**self.wrists, **{prop.name: prop.body for prop in self.objects}}


@dataclass(frozen=True, slots=True)
class ServerConfig:
    """The configuration of one server. `check` says whether a server can be started from it."""

    actors: tuple[ActorConfig, ...]
    demo: bool = option(
        False, Switch(), "play the bundled recording through the server's own sockets, over and over", group=TRACKED
    )
    objects: Path | None = option(
        None,
        Folder(),
        "folder of your own meshes; clients can choose them, and changed files are reloaded",
        group=TRACKED,
    )
    objects_unit: str = option("m", Choice(tuple(UNITS_M)), "unit of the meshes in that folder", group=TRACKED)
    model: str = option(DEFAULT_MODEL, Text("NAME"), "name of a shipped model, or the folder of one", group=SYNTHESIS)
    provider: Provider = option(
        "auto", Choice(PROVIDERS), "what the network runs on; auto takes a GPU if one can be used", group=SYNTHESIS
    )
    solver: str = option(
        DEFAULT_SOLVER,
        Choice(tuple(SOLVERS)),
        "inverse kinematics that corrects the contacts: " + ", ".join(f"{s.name} ({s.help})" for s in SOLVERS.values()),
        group=SYNTHESIS,
    )
    look_ahead_s: float = option(
        MAX_LOOK_AHEAD_S,
        Number(0.0, MAX_LOOK_AHEAD_S, "seconds"),
        "how much future motion to wait for; the rest of the half second that the model needs is forecast",
        key="look_ahead",
        group=SYNTHESIS,
    )
    host: str = option("127.0.0.1", Text("ADDRESS"), "address of this machine to listen on", group=SERVER)
    control_port: int = option(CONTROL_PORT, Port(), "TCP port for control requests (ZeroMQ REP)", group=SERVER)
    page_port: int = option(8080, Port(), "TCP port of the live page (HTTP and WebSocket)", group=SERVER)
    metrics_port: int | None = option(
        None, Port(), "TCP port of metrics for Prometheus (HTTP); by default no metrics are served", group=SERVER
    )
    trigger_port: int = option(
        TRIGGER_PORT, Port(), "UDP port on which Motive's remote trigger begins and ends recordings", group=SERVER
    )
    trigger_host: str = option(
        "127.0.0.1",
        Text("ADDRESS"),
        "address of this machine for that port; 0.0.0.0 for the broadcast of a Motive on another machine",
        group=SERVER,
    )
    keys: Path | None = option(
        None, Folder(), "let only clients with keys connect over ZeroMQ; `manipnet keys` makes the keys", group=SERVER
    )
    allow: tuple[Network, ...] = option(
        (),
        Networks(),
        "network that may send OSC, or more frames over NatNet; repeatable",
        group=SERVER,
    )
    insecure: bool = option(
        False, Switch(), "let any machine connect if --host is not a loopback address", group=SERVER
    )
    takes: Path = option(Path("takes"), Folder(), "folder for recordings", group=FILES)
    dump_dir: Path | None = option(
        None,
        Folder(),
        "folder for the frames that led to an internal error; a folder of the user by default",
        group=FILES,
    )
    protocols: tuple[Any, ...] = ()
    """The options of inputs and outputs: one instance of each `Input.options` and `Output.options`, as far as they
    differ from their defaults. `of` finds them."""
    rig: Path | None = None
    """The rig file that this configuration came from, in which calibrations are stored."""

    @property
    def is_exposed(self) -> bool:
        """Whether machines that nobody has listed may connect, which only `insecure` allows."""
        return not is_loopback(self.host) and (self.keys is None or not self.allow)

    @property
    def body_keys(self) -> frozenset[BodyKey]:
        """The bodies of all actors, by id or name."""
        parts = (body for actor in self.actors for body in actor.bodies().values())
        return frozenset(body.key for body in parts)

    def of(self, options: type[T]) -> T:
        """The options of one input or output, for example `config.of(OscOptions)`."""
        return next((given for given in self.protocols if type(given) is options), None) or options()


def protocol_options() -> tuple[type, ...]:
    """The dataclasses in which inputs and outputs declare their options."""
    return tuple(declared.options for declared in (*inputs.INPUTS, *outputs.OUTPUTS))


def input_options() -> tuple[Option, ...]:
    """The options of all inputs, for other programs that receive tracked bodies."""
    return tuple(each for declared in inputs.INPUTS for each in options_of(declared.options))


def all_options() -> dict[str, Option]:
    """Every option of a server by its key, which is its name in a rig file's `[server]` table."""
    return {each.key: each for declaring in (ServerConfig, *protocol_options()) for each in options_of(declaring)}


def server_config(actors: tuple[ActorConfig, ...], values: Mapping[str, Any], rig: Path | None = None) -> ServerConfig:
    """A configuration from the values of its options by key. The other options keep their defaults."""
    protocols = tuple(from_keys(declaring, values) for declaring in protocol_options())
    return from_keys(ServerConfig, values, actors=actors, protocols=protocols, rig=rig)


def default_actor(objects: tuple[ObjectConfig, ...] = ()) -> ActorConfig:
    """The actor of a server without a rig file: its wrists are the bodies named like `WRISTS`."""
    return ActorConfig("actor", {wrist: BodyConfig(wrist) for wrist in WRISTS}, objects)


def control_endpoint(text: str) -> Endpoint:
    """The control port of a server from `HOST`, `HOST:PORT` or `tcp://HOST:PORT`. Raises `ConfigError`."""
    return parse_endpoint(text.removeprefix("tcp://"), CONTROL_PORT)


def parse_object(text: str) -> ObjectConfig:
    """The prop of `--mesh NAME=FILE`: the body NAME carries the mesh FILE. Raises `ConfigError`."""
    name, mesh = parse_mesh(text)
    return ObjectConfig(name, BodyConfig(int(name) if name.isdecimal() else name), mesh)


def parse_mesh(text: str) -> tuple[str, Path]:
    """A name and a mesh file from `NAME=FILE`, where FILE may also be the name of an object of the library.

    Raises `ConfigError`.
    """
    name, _, file = text.partition("=")
    if not (name and file):
        raise ConfigError(f"--mesh {text}: must be NAME=FILE, for example Box=meshes/mug.obj or Box=mug")
    return name, Path(file) if Path(file).is_file() else library_file(file) or Path(file)


def check(config: ServerConfig) -> None:
    """Raise `ConfigError` unless a server can be started from `config`."""
    for declared in (config, *config.protocols):
        check_values(declared)
    if config.is_exposed and not config.insecure:
        raise ConfigError(
            f"--host {config.host} can be reached from other machines, and nothing keeps strangers out. Give "
            "--keys FOLDER for ZeroMQ (see `manipnet keys`) and --allow NETWORK for OSC; or stay on 127.0.0.1 and use "
            "a tunnel (ssh -L); or add --insecure on a network that you trust"
        )
    if not (is_loopback(config.trigger_host) or config.allow or config.insecure):
        raise ConfigError(
            f"--trigger-host {config.trigger_host} can be reached from other machines, any of which could begin and "
            "end recordings. Give --allow NETWORK with the network of Motive's machine, or --insecure on a network "
            "that you trust"
        )
    _check_actors(config.actors)


def _check_actors(actors: tuple[ActorConfig, ...]) -> None:
    if not 0 < len(actors) <= MAX_ACTORS:
        raise ConfigError(f"there are {len(actors)} actors; 1 … {MAX_ACTORS} are allowed")
    if twice := _repeated([actor.name for actor in actors]):
        raise ConfigError(f"two actors are named {twice!r}; give one of them another name")
    for actor in actors:
        where = f"actor {actor.name!r}"
        if not actor.wrists:
            raise ConfigError(f"{where} has no wrist; it needs at least one of {', '.join(WRISTS)}")
        if len(actor.objects) > MAX_OBJECTS:
            raise ConfigError(f"{where} has {len(actor.objects)} objects; at most {MAX_OBJECTS} are allowed")
        if twice := _repeated([*WRISTS, *(thing.name for thing in actor.objects)]):
            raise ConfigError(f"{where} has two parts named {twice!r}; give the object another name")
        bodies = [*actor.wrists.values(), *(thing.body for thing in actor.objects)]
        if twice := _repeated([str(body.key) for body in bodies]):
            raise ConfigError(f"{where} uses body {twice!r} twice; a body carries only one wrist or object")


def _repeated(names: list[str]) -> str | None:
    return next((name for i, name in enumerate(names) if name in names[:i]), None)
