"""What a server is told before it starts: frozen values, checked here, whoever filled them in."""

import ipaddress
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal

from manipnet.geometry import Array
from manipnet.net.addresses import Network
from manipnet.synthesis.model.layout import MAX_LOOK_AHEAD_S
from manipnet.synthesis.model.providers import DEFAULT_MODEL, Provider
from manipnet.synthesis.objects.library import library_file

BodyKey = int | str
"""Streaming id or name of a body, as its sender gives it."""

WRISTS: Final = ("left_wrist", "right_wrist")
MAX_ACTORS: Final = 16
MAX_OBJECTS: Final = 32
SCALE_RANGE: Final = (0.2, 5.0)
"""Sizes of a hand or a prop over their own that make sense."""


class ConfigError(ValueError):
    """Something the server is told makes no sense; the text names where, what, and what is allowed."""


@dataclass(frozen=True, slots=True)
class BodyConfig:
    """A streamed body and where on it the thing of interest sits: `offset (7,)` is T_body_thing, or None."""

    key: BodyKey
    offset: Array | None = None


@dataclass(frozen=True, slots=True)
class ObjectConfig:
    """A prop: the body that carries it, its mesh file, and the name clients know it by."""

    name: str
    body: BodyConfig
    mesh: Path
    unit: str = "m"
    scale: float = 1.0


@dataclass(frozen=True, slots=True)
class ActorConfig:
    """One pair of hands and the props they may take. `hand_scale` is the size of the hands over the model's."""

    name: str
    wrists: dict[str, BodyConfig]
    """By `WRISTS`; one may be missing."""
    objects: tuple[ObjectConfig, ...] = ()
    hand_scale: float = 1.0
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Lower and upper limit in radians of some angles of `wire.hand_names.ANGLE_NAMES`, inside the model's own."""


@dataclass(frozen=True, slots=True)
class ServerConfig:
    """Everything about one server."""

    actors: tuple[ActorConfig, ...]
    host: str = "127.0.0.1"
    port: int = 5555
    input_port: int = 5556
    control_port: int = 5557
    osc_port: int = 39540
    page_port: int = 8080
    web_port: int = 8081
    metrics_port: int | None = None
    natnet: tuple[str, int] | None = None
    """Motive to connect to; the three below are about it."""
    multicast: bool = False
    interface: str | None = None
    up: Literal["y", "z"] = "y"
    vmc: tuple[str, int] | None = None
    livelink: tuple[str, int] | None = None
    model: str = DEFAULT_MODEL
    provider: Provider = "auto"
    look_ahead_s: float = MAX_LOOK_AHEAD_S
    objects: Path | None = None
    """Folder of the user's own object meshes."""
    objects_unit: str = "m"
    """Their unit."""
    keys: Path | None = None
    """Folder of the CURVE keys of `manipnet keys`."""
    allow: tuple[Network, ...] = ()
    """Networks that may send OSC; none given means any that reaches the port."""
    insecure: bool = False
    demo: bool = False
    takes: Path = Path("takes")
    """Folder of the recordings."""
    dump_dir: Path | None = None
    rig: Path | None = None
    """The file this came from, where calibrations are stored."""


def default_actor(objects: tuple[ObjectConfig, ...] = ()) -> ActorConfig:
    """Who is expected when nobody says otherwise: bodies named like `WRISTS`."""
    return ActorConfig("actor", {wrist: BodyConfig(wrist) for wrist in WRISTS}, objects)


def parse_object(text: str) -> ObjectConfig:
    """`NAME=FILE`: the body NAME carries the mesh FILE, or one of the library by name. Raises `ConfigError`."""
    name, equals, file = text.partition("=")
    if not (name and equals and file):
        raise ConfigError(f"{text!r} is no NAME=FILE, for example Box=meshes/mug.obj or Box=mug")
    mesh = Path(file) if Path(file).is_file() else library_file(file) or Path(file)
    return ObjectConfig(name, BodyConfig(int(name) if name.isdecimal() else name), mesh)


def parse_endpoint(text: str, default_port: int) -> tuple[str, int]:
    """`HOST` or `HOST:PORT`, an IPv6 address in brackets. Raises `ConfigError`."""
    host, port = text, ""
    if text.startswith("["):
        host, _, port = text[1:].partition("]")
        port = port.removeprefix(":")
    elif text.count(":") == 1:
        host, _, port = text.partition(":")
    if not host or (port and not (port.isdecimal() and 0 < int(port) < 65536)):
        raise ConfigError(f"{text!r} is no HOST[:PORT]; a port is 1 … 65535")
    return host, int(port) if port else default_port


def parse_network(text: str) -> Network:
    """An address, or a network as `192.168.1.0/24`. Raises `ConfigError`."""
    try:
        return ipaddress.ip_network(text, strict=False)
    except ValueError:
        raise ConfigError(f"{text!r} is no address or network, for example 192.168.1.7 or 192.168.1.0/24") from None


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach `host`."""
    try:
        address = ipaddress.ip_address(host)
        return (getattr(address, "ipv4_mapped", None) or address).is_loopback
    except ValueError:
        return host == "localhost"


def check(config: ServerConfig) -> None:
    """Raise `ConfigError` unless a server can be started from this."""
    for option in ("port", "input_port", "control_port", "osc_port", "page_port", "web_port", "metrics_port"):
        port = getattr(config, option)
        if port is not None and not 0 <= port < 65536:
            raise ConfigError(f"--{option.replace('_', '-')} is {port}; allowed are 0 (any free one) … 65535")
    if not 0.0 <= config.look_ahead_s <= MAX_LOOK_AHEAD_S:
        raise ConfigError(f"look_ahead is {config.look_ahead_s} s; allowed are 0 … {MAX_LOOK_AHEAD_S} s")
    if not (is_loopback(config.host) or config.insecure or (config.keys is not None and config.allow)):
        raise ConfigError(
            f"--host {config.host} can be reached from other machines, and nothing would keep strangers out. "
            "Give --keys FOLDER for ZeroMQ (`manipnet keys`) and --allow NETWORK for OSC; or stay on 127.0.0.1 and "
            "tunnel (ssh -L); or add --insecure on a network you trust"
        )
    _check_actors(config.actors)


def _check_actors(actors: tuple[ActorConfig, ...]) -> None:
    if not 0 < len(actors) <= MAX_ACTORS:
        raise ConfigError(f"{len(actors)} actors; allowed are 1 … {MAX_ACTORS}")
    if twice := _repeated([actor.name for actor in actors]):
        raise ConfigError(f"two actors are named {twice!r}; names tell them apart")
    for actor in actors:
        where = f"actor {actor.name!r}"
        if not actor.wrists:
            raise ConfigError(f"{where} has no wrist; give at least one of {', '.join(WRISTS)}")
        if len(actor.objects) > MAX_OBJECTS:
            raise ConfigError(f"{where} has {len(actor.objects)} objects; allowed are {MAX_OBJECTS}")
        if twice := _repeated([*WRISTS, *(thing.name for thing in actor.objects)]):
            raise ConfigError(f"{where} has two things named {twice!r}; give the object another name")
        bodies = [*actor.wrists.values(), *(thing.body for thing in actor.objects)]
        if twice := _repeated([str(body.key) for body in bodies]):
            raise ConfigError(f"{where} uses body {twice!r} twice; a body carries one thing")


def _repeated(names: list[str]) -> str | None:
    return next((name for i, name in enumerate(names) if name in names[:i]), None)
