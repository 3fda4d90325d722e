"""Options of the server. Each one is declared once, as a dataclass field with its kind of value and its help.

The flags of the command line, the keys of a rig file's `[server]` table, the checks, the printed configuration and the
tables of the documentation follow from the declarations:

    @dataclass(frozen=True)
    class OscOptions:
        osc_port: int = option(39540, Port(), "UDP port that receives tracked bodies over OSC")
"""

import ipaddress
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any, Final, TypeVar

Endpoint = tuple[str, int]
Network = ipaddress.IPv4Network | ipaddress.IPv6Network
T = TypeVar("T")

_METADATA: Final = "option"


class ConfigError(ValueError):
    """A wrong option or rig file. The text says where it is, what is wrong and what is allowed."""


class Kind:
    """A kind of value: how it is read from a rig file or from the command line, and how it is written."""

    metavar: str = ""
    """The value's placeholder in `--help`; empty for a flag without a value."""
    repeatable: bool = False
    """Whether the flag may be given several times, each time with one more value."""
    allowed: str = ""
    """What a value must be, as the end of the sentence "it must be …"."""

    def read(self, value: Any, folder: Path) -> Any:
        """The value of an option from a TOML value. Relative paths start at `folder`. Raises `ValueError`."""
        raise NotImplementedError

    def parse(self, text: Any) -> Any:
        """The value of an option from the text after a flag, or the list of texts. Raises `ValueError`."""
        return self.read(text, Path())

    def write(self, value: Any) -> Any:
        """The TOML value that `read` turns into `value`."""
        return value


@dataclass(frozen=True)
class Text(Kind):
    """Any text."""

    metavar: str
    allowed: str = "text"

    def read(self, value: Any, folder: Path) -> str:
        return _require(value, isinstance(value, str))


@dataclass(frozen=True)
class Choice(Kind):
    """One of some words."""

    words: Sequence[str]

    @property
    def metavar(self) -> str:
        return f"{{{','.join(self.words)}}}"

    @property
    def allowed(self) -> str:
        return f"one of {', '.join(self.words)}"

    def read(self, value: Any, folder: Path) -> str:
        return _require(value, isinstance(value, str) and value in self.words)


class Switch(Kind):
    """True or false. On the command line, the flag alone means true."""

    allowed = "true or false"

    def read(self, value: Any, folder: Path) -> bool:
        return _require(value, isinstance(value, bool))


class Port(Kind):
    """The number of a port to listen on."""

    metavar = "PORT"
    allowed = "a port number, 0 … 65535, where 0 stands for any free port"

    def read(self, value: Any, folder: Path) -> int:
        return _require(value, type(value) is int and 0 <= value < 65536)

    def parse(self, text: Any) -> int:
        return self.read(int(text), Path())


@dataclass(frozen=True)
class Number(Kind):
    """A number from `low` to `high`, in `unit`."""

    low: float
    high: float
    unit: str

    @property
    def metavar(self) -> str:
        return self.unit.upper()

    @property
    def allowed(self) -> str:
        return f"a number of {self.unit}, {self.low:g} … {self.high:g}"

    def read(self, value: Any, folder: Path) -> float:
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        return float(_require(value, is_number and self.low <= value <= self.high))

    def parse(self, text: Any) -> float:
        return self.read(float(text), Path())


class Folder(Kind):
    """The path of a folder. In a rig file, a relative path starts at the file's own folder."""

    metavar = "FOLDER"
    allowed = "the path of a folder, as text"

    def read(self, value: Any, folder: Path) -> Path:
        return folder / _require(value, isinstance(value, str))

    def write(self, value: Path) -> str:
        return str(value.resolve())


class File(Folder):
    """The path of a file. In a rig file, a relative path starts at the file's own folder."""

    metavar = "FILE"
    allowed = "the path of a file, as text"


@dataclass(frozen=True)
class HostPort(Kind):
    """The address of another program, with a default port."""

    default_port: int
    host: str = "HOST"

    @property
    def metavar(self) -> str:
        return f"{self.host}[:{self.default_port}]"

    @property
    def allowed(self) -> str:
        return "HOST or HOST:PORT with a port of 1 … 65535, for example 192.168.1.7 or [fe80::1]:1510"

    def read(self, value: Any, folder: Path) -> Endpoint:
        return _split_endpoint(_require(value, isinstance(value, str)), self.default_port)

    def write(self, value: Endpoint) -> str:
        host, port = value
        return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


@dataclass(frozen=True)
class Endpoints(Kind):
    """Addresses of other programs, each with its port."""

    scheme: str
    repeatable = True

    @property
    def metavar(self) -> str:
        return f"{self.scheme}://HOST:PORT"

    @property
    def allowed(self) -> str:
        return f"addresses of the form {self.scheme}://HOST:PORT with a port of 1 … 65535"

    def read(self, value: Any, folder: Path) -> tuple[Endpoint, ...]:
        texts = _require(value, isinstance(value, list) and all(isinstance(text, str) for text in value))
        return tuple(self._endpoint(text) for text in texts)

    def _endpoint(self, text: str) -> Endpoint:
        scheme, found, rest = text.partition("://")
        host, port = _split_endpoint(rest if found else text, 0)
        return _require((host, port), port > 0 and scheme in ((self.scheme,) if found else (text,)))

    def write(self, value: tuple[Endpoint, ...]) -> list[str]:
        return [f"{self.scheme}://{f'[{host}]' if ':' in host else host}:{port}" for host, port in value]


class Networks(Kind):
    """Addresses and networks."""

    metavar = "NETWORK"
    repeatable = True
    allowed = "addresses or networks, as text, for example 192.168.1.7 or 192.168.1.0/24"

    def read(self, value: Any, folder: Path) -> tuple[Network, ...]:
        texts = _require(value, isinstance(value, list) and all(isinstance(text, str) for text in value))
        return tuple(ipaddress.ip_network(text, strict=False) for text in texts)

    def write(self, value: tuple[Network, ...]) -> list[str]:
        return [str(network) for network in value]


@dataclass(frozen=True)
class Option:
    """A declared option: the dataclass `field` that holds its value, and its `key` in a rig file."""

    field: str
    key: str
    kind: Kind
    default: Any
    help: str
    group: str
    """The heading of the option in `--help`; empty for the options of a protocol, whose heading is the protocol's."""

    @property
    def flag(self) -> str:
        """The option's flag on the command line."""
        return f"--{self.key.replace('_', '-')}"

    @property
    def shown_default(self) -> str:
        """The default value as text, empty if the option is off by default."""
        return "" if self.default in (None, (), False) else str(self.default)

    def read(self, value: Any, folder: Path, where: str) -> Any:
        """The option's value from a TOML value at `where`. Raises `ConfigError`."""
        return self._converted(lambda: self.kind.read(value, folder), value, where)

    def parse(self, text: Any) -> Any:
        """The option's value from the command line. Raises `ConfigError`."""
        return self._converted(lambda: self.kind.parse(text), text, self.flag)

    def _converted(self, convert: Callable[[], Any], value: Any, where: str) -> Any:
        try:
            return convert()
        except ConfigError as error:  # the kind knows better what is wrong
            raise ConfigError(f"{where} {error}") from None
        except ValueError:
            raise ConfigError(f"{where} is {shorten(value)}; it must be {self.kind.allowed}") from None


@dataclass(frozen=True)
class Protocol:
    """A protocol of an input or an output, and the options that it declares."""

    name: str
    """Its name in the counters."""
    summary: str
    """A few words on who uses it, and how."""
    options: type
    """The dataclass of its options. The first one is the port to listen on, the other program's address or a switch."""
    ready_name: str = field(default="", kw_only=True)
    """Its name in the `ready` line and in the request `status`, if that is not `name`."""

    @property
    def title(self) -> str:
        """Its name in the `ready` line and in the request `status`."""
        return self.ready_name or self.name

    @property
    def where(self) -> Option:
        """The option for its port or address."""
        return options_of(self.options)[0]

    @property
    def default_port(self) -> int | None:
        """The port that it uses unless an option says otherwise; None for a protocol that chooses its own."""
        kind = self.where.kind
        if isinstance(kind, Switch):
            return None
        return kind.default_port if isinstance(kind, HostPort) else self.where.default

    def is_on(self, options: Any) -> bool:
        """Whether an instance of its options turns it on."""
        value = getattr(options, self.where.field)
        return value is not None and value is not False


def option(default: Any, kind: Kind, help: str, *, key: str = "", group: str = "") -> Any:
    """A dataclass field that is an option. Its key is the field's name unless `key` says otherwise."""
    return field(default=default, metadata={_METADATA: (kind, help, key, group)})


@cache
def options_of(declaring: type) -> tuple[Option, ...]:
    """The options that a dataclass declares, in order; its other fields are left out."""
    declared = [(each, each.metadata[_METADATA]) for each in fields(declaring) if _METADATA in each.metadata]
    return tuple(
        Option(each.name, key or each.name, kind, each.default, help, group)
        for each, (kind, help, key, group) in declared
    )


def from_keys(declaring: type[T], values: Mapping[str, Any], **others: Any) -> T:
    """An instance with the `values` of its options by key, of which it takes those it declares."""
    given = {each.field: values[each.key] for each in options_of(declaring) if each.key in values}
    return declaring(**given, **others)


def to_toml(declared: Any) -> dict[str, Any]:
    """The options of an instance that have a value, by key, as a rig file holds them."""
    values = {each: getattr(declared, each.field) for each in options_of(type(declared))}
    return {each.key: each.kind.write(value) for each, value in values.items() if value not in (None, ())}


def check_values(declared: Any) -> None:
    """Raise `ConfigError` for an option of an instance whose value is not allowed."""
    for each in options_of(type(declared)):
        value = getattr(declared, each.field)
        if value is not None:
            each.read(each.kind.write(value), Path(), each.flag)


def parse_endpoint(text: str, default_port: int) -> Endpoint:
    """Host and port of `HOST` or `HOST:PORT`, with an IPv6 address in brackets. Raises `ConfigError`."""
    try:
        return _split_endpoint(text, default_port)
    except ValueError:
        raise ConfigError(f"{text!r} is not an address; it must be {HostPort(default_port).allowed}") from None


def shorten(value: Any) -> str:
    """A value as error messages show it, in at most one line."""
    text = repr(value)
    return text if len(text) <= 60 else f"{type(value).__name__} of {len(text)} characters"


def _split_endpoint(text: str, default_port: int) -> Endpoint:
    host, port = text, ""
    if text.startswith("["):
        host, _, port = text[1:].partition("]")
        port = port.removeprefix(":")
    elif text.count(":") == 1:
        host, _, port = text.partition(":")
    if not host or (port and not (port.isdecimal() and 0 < int(port) < 65536)):
        raise ValueError
    return host, int(port) if port else default_port


def _require(value: T, allowed: bool) -> T:
    if not allowed:
        raise ValueError
    return value
