"""`manipnet-serve --demo`: a recorded performance, played for ever through the server's own bodies socket."""

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
"""Made by `python -m manipnet_tools.assets.demo_recording`. It ends in the pose it begins with."""
DEMO_OBJECTS: Final = ("cube", "cylinder", "mug")
"""Bodies of the recording besides the wrists, each a mesh of the library."""

_log = logging.getLogger(__name__)


def demo_objects(others: tuple[ObjectConfig, ...] = ()) -> tuple[ObjectConfig, ...]:
    """The props of the performance, with meshes of the library or with the `others` of the same name.

    Raises `ConfigError` for one of the others that the performance does not have.
    """
    given = {thing.name: thing for thing in others}
    if unknown := given.keys() - set(DEMO_OBJECTS):
        raise ConfigError(f"--mesh {min(unknown)}=…: with --demo the bodies are {', '.join(DEMO_OBJECTS)}")
    own = {name: ObjectConfig(name, BodyConfig(name), LIBRARY_FOLDER / f"{name}.ply") for name in DEMO_OBJECTS}
    return tuple((own | given).values())


class Demo:
    """Plays the performance from `start` to `stop`, in a thread of its own."""

    def __init__(self, path: Path = DEMO_FILE) -> None:
        """Raises `ConfigError` for a recording that cannot be read."""
        try:
            self._frames = list(read_bodies(path))
        except RecordingError as error:
            raise ConfigError(f"--demo: {error}") from None
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self, address: str) -> None:
        """Play into the socket bound to `tcp://HOST:PORT`."""
        host, port = connectable(address)
        self._thread = threading.Thread(target=self._run, args=(host, port), name="demo", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop playing; harmless when not started."""
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
    """Host and port to reach a socket bound to `tcp://HOST:PORT` from this machine; HOST may stand for all."""
    host, _, port = address.removeprefix("tcp://").rpartition(":")
    ip = ipaddress.ip_address(host.strip("[]"))
    if ip.is_unspecified:
        ip = ipaddress.ip_address("127.0.0.1" if ip.version == 4 else "::1")
    return str(ip), int(port)
