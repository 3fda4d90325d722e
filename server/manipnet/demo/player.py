"""`manipnet-serve --demo`: a recorded performance, played again and again through the server's own bodies socket."""

import ipaddress
import logging
import threading
from pathlib import Path
from typing import Final

from manipnet.common.options import ConfigError
from manipnet.config.settings import BodyConfig, ObjectConfig
from manipnet.inputs.playback import PlayError, ZmqBodySender, looped, play
from manipnet.recording.mcap_file import RecordingError, read_bodies
from manipnet.synthesis.objects.library import LIBRARY_FOLDER

DEMO_FILE: Final = Path(__file__).with_name("demo.mcap")
"""Made by `python -m manipnet_tools.assets.demo_recording`. It ends in the pose in which it begins."""
DEMO_OBJECTS: Final = ("cube", "cylinder", "mug")
"""The props of the recording; each carries the library's mesh of the same name."""

_log = logging.getLogger(__name__)


def demo_objects(replacements: tuple[ObjectConfig, ...] = ()) -> tuple[ObjectConfig, ...]:
    """The props of the performance, with meshes of the library or the `replacements` of the same name.

    Raises `ConfigError` for a replacement of a prop that the performance does not have.
    """
    given = {prop.name: prop for prop in replacements}
    if unknown := given.keys() - set(DEMO_OBJECTS):
        raise ConfigError(f"--mesh {min(unknown)}=…: with --demo the bodies are {', '.join(DEMO_OBJECTS)}")
    library = {name: ObjectConfig(name, BodyConfig(name), LIBRARY_FOLDER / f"{name}.ply") for name in DEMO_OBJECTS}
    return tuple((library | given).values())


class Demo:
    """Plays the performance from `start` to `stop`, on a thread of its own."""

    def __init__(self, path: Path = DEMO_FILE) -> None:
        """Raises `ConfigError` for a recording that cannot be read."""
        try:
            self._frames = list(read_bodies(path))
        except RecordingError as error:
            raise ConfigError(f"--demo: {error}") from None
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self, address: str) -> None:
        """Begin to play into the socket that is bound to `tcp://HOST:PORT`."""
        host, port = connectable(address)
        self._thread = threading.Thread(target=self._run, args=(host, port), name="demo", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop playing; does nothing if it was not started."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join()

    def _run(self, host: str, port: int) -> None:
        try:
            sender = ZmqBodySender(host, port, self._stopping)
        except PlayError as error:
            if not self._stopping.is_set():
                _log.error("the demo cannot be played: %s", error)
            return
        try:
            play(looped(self._frames), sender, stopping=self._stopping)
        except PlayError as error:
            _log.error("the demo has ended: %s", error)
        finally:
            sender.close()


def connectable(address: str) -> tuple[str, int]:
    """Host and port at which this machine reaches a socket bound to `tcp://HOST:PORT`, where HOST may mean all."""
    host, _, port = address.removeprefix("tcp://").rpartition(":")
    ip = ipaddress.ip_address(host.strip("[]"))
    if ip.is_unspecified:
        ip = ipaddress.ip_address("127.0.0.1" if ip.version == 4 else "::1")
    return str(ip), int(port)
