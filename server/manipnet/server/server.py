"""The life of a server: it loads, listens, runs its loop, and closes everything."""

import gc
import logging
import sys
from collections.abc import Callable
from contextlib import ExitStack
from typing import TYPE_CHECKING, Final

from manipnet.common.options import ConfigError
from manipnet.config.settings import ServerConfig, check
from manipnet.jit import seal_cache
from manipnet.net.curve_keys import read_server_keys
from manipnet.recording.recording_lines import RecordingLines
from manipnet.runtime.clock_watch import ClockWatch
from manipnet.runtime.run_file import announce, withdraw
from manipnet.runtime.status import SecondLines, SilenceWatch
from manipnet.server.services import open_services
from manipnet.server.session import Session

if TYPE_CHECKING:
    from manipnet.demo.player import Demo

SWITCH_INTERVAL_S: Final = 0.001
"""How long a busy thread may keep the interpreter: a receiver must not wait the usual 5 ms for a tick."""

_log = logging.getLogger(__name__)


class Server:
    """A server that turns tracked bodies into hands.

    From Python, in a module whose main part is guarded by `if __name__ == "__main__":`, because large meshes and the
    live page run in processes of their own:

        actor = default_actor((parse_object("Box=mug"),))
        Server(ServerConfig((actor,)), say=print).run()
    """

    def __init__(
        self,
        config: ServerConfig,
        say: Callable[[str], None] = _log.info,
        wait_for_kernels: Callable[[], object] = lambda: None,
        show: Callable[[str], None] = lambda status: None,
    ) -> None:
        """Load the model, the objects and the keys; nothing listens yet.

        `say` shows a line to a person: `ready` with all addresses, then one for each change, and at the end what was
        kept. `show` shows the state of each second in place of that of the last. Both must return at once.
        `wait_for_kernels` returns when another process has compiled kernels that this one would compile otherwise.
        Raises `ConfigError`, `KeyFileError`, `BundleError` and `MeshError`.
        """
        check(config)
        self.addresses: dict[str, str] = {}
        """The address of every socket by what it carries, while the server runs."""
        self._say, self._show = say, show
        self._keys = None if config.keys is None else read_server_keys(config.keys)
        self._session = Session(config, wait_for_kernels)
        self._seconds = SecondLines(self._session.actors, self._session.telemetry)
        self._silence, self._clocks = SilenceWatch(), ClockWatch()
        self._demo = self._load_demo() if config.demo else None

    def run(self, stopping: Callable[[], bool] = lambda: False) -> None:
        """Listen, say `ready`, and turn bodies into hands until `stopping` returns True; then close everything.

        Raises `ListenError` for an address that cannot be listened on, and `ConfigError` for a receiver of hands whose
        name is unknown.
        """
        self._session.warm_up()
        seal_cache()
        with ExitStack() as opened:
            services = open_services(self._session, self._keys, opened)
            self.addresses, self._recordings = services.addresses, RecordingLines(services.recorder)
            sys.setswitchinterval(SWITCH_INTERVAL_S)
            gc.collect()
            gc.freeze()
            self._say("ready " + " ".join(f"{what} {address}" for what, address in self.addresses.items()))
            announce(self.addresses, self._keys is not None)
            opened.callback(withdraw)
            if self._session.config.is_exposed:
                _log.warning(
                    "--insecure: every machine that reaches %s may send bodies, receive hands and change the session; "
                    "use --keys and --allow outside of a network that you trust",
                    self._session.config.host,
                )
            if self._demo is not None:
                opened.callback(self._demo.stop)
                self._demo.start(self.addresses["bodies"])
            services.loop.run(stopping, self._every_second)
        self._say(f"stopped; {self._recordings.kept()}")

    def _load_demo(self) -> "Demo":
        from manipnet.demo.player import Demo  # its libraries are of no use to a live session

        if self._keys is not None:
            raise ConfigError("--demo plays through a socket that requires keys, and has none; leave out --keys")
        return Demo()

    def _every_second(self, now_s: float) -> None:
        second, recording = self._seconds.next(now_s), self._recordings.next()
        for change in (*second.changes, *recording.changes):
            self._say(change)
        self._show(" | ".join(filter(None, (recording.status, second.status))))
        self._silence.look(self._session.actors, now_s)
        self._clocks.look(self._session.senders.report(now_s), self._session.telemetry.counts())
