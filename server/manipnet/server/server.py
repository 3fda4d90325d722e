"""The life of a server: configure, start, loop, stop."""

import gc
import logging
import secrets
import sys
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING

from platformdirs import user_log_path

from manipnet import __version__
from manipnet.actors.actor import Actor
from manipnet.actors.props import Prop
from manipnet.common.options import ConfigError
from manipnet.config.settings import ActorConfig, ServerConfig, check
from manipnet.control.actors_proxy import ActorsProxy
from manipnet.control.calibration_requests import CalibrationRequests
from manipnet.control.peers import Peers
from manipnet.control.request import Handler
from manipnet.control.service import Control
from manipnet.control.session_requests import Requests
from manipnet.inputs import make_receivers, start_receivers
from manipnet.inputs.sender_stats import SenderStats
from manipnet.net.curve_keys import read_server_keys
from manipnet.outputs import open_outputs
from manipnet.outputs.declaration import Emission
from manipnet.outputs.publisher import Publisher
from manipnet.page.supervisor import LivePage
from manipnet.recording.recorder import Recorder, carried
from manipnet.runtime.flight_recorder import FlightRecorder
from manipnet.runtime.mailbox import Mailbox
from manipnet.runtime.mesh_watch import MeshWatch
from manipnet.runtime.object_catalog import ObjectCatalog
from manipnet.runtime.prometheus import MetricsPage
from manipnet.runtime.status import SilenceWatch, second_line
from manipnet.runtime.tick_loop import TickLoop
from manipnet.runtime.warm_up import pose_a_hand, warm_up
from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.objects.shape import Shape
from manipnet.synthesis.synthesizer import Synthesizer
from manipnet.telemetry import Telemetry

if TYPE_CHECKING:
    from manipnet.demo.player import Demo

SWITCH_INTERVAL_S = 0.001
"""How long a busy thread may keep the interpreter: a receiver must not wait the usual 5 ms for a tick."""
LOOPBACK = "127.0.0.1"
WARM_UP_SHAPE = "cube"
"""What to warm up with when there is no prop yet."""

_log = logging.getLogger(__name__)


class Server:
    """One server. `say` shows a line to a person and must return at once."""

    def __init__(
        self, config: ServerConfig, say: Callable[[str], None], compiled_aside: Callable[[], object] = lambda: None
    ) -> None:
        """Load what is configured; listen to nothing yet. Raises `ConfigError`, `KeyFileError`,
        `BundleError` and `MeshError`.

        `compiled_aside` returns once another process has compiled what this one does not.
        """
        check(config)
        self._config, self._say = config, say
        self.session = secrets.token_hex(8)
        self.telemetry = Telemetry()
        self._mailbox, self._watch = Mailbox(self.telemetry), SilenceWatch()
        self._catalog = ObjectCatalog(config.objects, config.objects_unit)
        self._senders = SenderStats(self._mailbox.put)
        self._around = Peers(self._senders)
        self.telemetry.add_gauges(self._around.gauges)
        self._keys = None if config.keys is None else read_server_keys(config.keys)
        self._bundle = load_bundle(config.model, config.provider)
        pose_a_hand(self._bundle, config.solver)
        compiled_aside()
        self._actors = [self._actor(actor) for actor in config.actors]
        self._shown = 0
        self._demo = self._make_demo() if config.demo else None

    def run(self, stopping: Callable[[], bool]) -> None:
        """Listen, say `ready`, turn bodies into hands until `stopping`, close everything.

        Raises `ListenError` for an address that is taken, and `ConfigError` for a receiver nobody knows.
        """
        shapes = self._catalog.shapes() or [self._catalog.shape(WARM_UP_SHAPE)]
        warm_up(self._bundle, shapes, self._config.solver)
        with ExitStack() as opened:
            loop, addresses = self._open(opened)
            sys.setswitchinterval(SWITCH_INTERVAL_S)
            gc.collect()
            gc.freeze()
            self._say("ready " + " ".join(f"{what} {address}" for what, address in addresses.items()))
            if self._demo is not None:
                opened.callback(self._demo.stop)
                self._demo.start(addresses["bodies"])
            loop.run(stopping, self._every_second)

    def _open(self, opened: ExitStack) -> tuple[TickLoop, dict[str, str]]:
        """Every socket, and the loop between them; `opened` closes them in reverse order."""
        config, telemetry = self._config, self.telemetry
        actors_proxy = ActorsProxy(self._actors, self._mailbox)
        recorder = Recorder(config.takes, lambda: self._about(actors_proxy), telemetry)
        opened.callback(recorder.stop)
        outputs = open_outputs(config.of, Emission(telemetry, config.host, self._keys))
        publisher = Publisher(outputs, telemetry, recorder.note)
        opened.callback(publisher.close)
        meshes = MeshWatch(self._catalog, lambda old, new: actors_proxy.ask(lambda: self._reshape(old, new)))
        opened.callback(meshes.stop)
        meshes.start()
        handlers = {**self._handlers(actors_proxy), **recorder.handlers()}
        handlers |= self._around.handlers(handlers["status"])
        control = Control(config.host, config.control_port, handlers, telemetry, self._keys)
        opened.callback(control.stop)
        control.start()
        page_host = LOOPBACK if self._keys is not None else config.host  # browsers have no keys
        page = LivePage(page_host, config.page_port, control.answer, telemetry)
        opened.callback(page.stop)
        page.start()
        receivers = make_receivers(config.of, self._senders, telemetry, config.host, self._keys, config.allow)
        start_receivers(receivers, opened)
        self._around.receivers = {declared.title: receiver for declared, receiver in receivers.items()}
        self._around.connected = lambda: {**publisher.connected(), "control": control.connected()}
        addresses = publisher.addresses
        addresses |= {declared.title: receiver.address for declared, receiver in receivers.items()}
        addresses |= {"control": control.address, "page": page.address}
        if config.metrics_port is not None:
            metrics = MetricsPage(LOOPBACK, config.metrics_port, telemetry)
            opened.callback(metrics.close)
            addresses["metrics"] = metrics.address
        return self._loop(publisher, page), addresses

    def _loop(self, publisher: Publisher, page: LivePage) -> TickLoop:
        return TickLoop(
            self.session,
            self._actors,
            Synthesizer(self._bundle, self._config.solver, self.telemetry.stages.ended),
            publisher.publish,
            self._mailbox,
            FlightRecorder(self._config.dump_dir or user_log_path("manipnet", appauthor=False)),
            self.telemetry,
            page,
        )

    def _handlers(self, actors_proxy: ActorsProxy) -> dict[str, Handler]:
        requests = Requests(
            self.session,
            self._bundle.name,
            self._bundle.model_hash,
            actors_proxy,
            self._catalog,
            self.telemetry,
        )
        return {**requests.handlers(), **CalibrationRequests(actors_proxy, self._config.rig).handlers()}

    def _reshape(self, old: Shape, new: Shape) -> None:
        for actor in self._actors:
            actor.reshape(old, new)

    def _about(self, actors_proxy: ActorsProxy) -> tuple[dict[str, str], list[Prop]]:
        """What a recording depends on."""
        props = actors_proxy.ask(lambda: [prop for actor in self._actors for prop in actor.props])
        bundle, rig = self._bundle, self._config.rig
        about = {"session": self.session, "version": __version__, "model": bundle.name, "model_hash": bundle.model_hash}
        about["objects"] = carried(props)
        with suppress(OSError, UnicodeDecodeError):  # a rig file that has gone since is no reason to record nothing
            about |= {"rig": rig.read_text(encoding="utf-8-sig")} if rig else {}
        return about, props

    def _make_demo(self) -> "Demo":
        from manipnet.demo.player import Demo  # its libraries are of no use to a live session

        if self._keys is not None:
            raise ConfigError("--demo plays through a socket that asks for keys, and has none; leave out --keys")
        return Demo()

    def _actor(self, config: ActorConfig) -> Actor:
        props = [self._catalog.load(thing) for thing in config.objects]
        return Actor(config, props, self._bundle, self.telemetry, self._config.look_ahead_s)

    def _every_second(self, now_s: float) -> None:
        shown = sum(actor.seq for actor in self._actors)
        self._say(second_line(self._actors, self.telemetry, shown - self._shown))
        self._shown = shown
        self._watch.look(self._actors, now_s)
