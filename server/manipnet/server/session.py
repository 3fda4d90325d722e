"""What a server works with before it listens: the model, the objects, the actors, and their way between threads."""

import secrets
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from platformdirs import user_log_path

from manipnet import __version__
from manipnet.actors.actor import Actor
from manipnet.actors.avatar import Avatar
from manipnet.actors.props import Prop
from manipnet.actors.spread import start_delays_s
from manipnet.config.settings import ActorConfig, ServerConfig
from manipnet.control.actors_proxy import ActorsProxy
from manipnet.control.body_gauges import body_gauges
from manipnet.control.calibration_requests import CalibrationRequests
from manipnet.control.hand_requests import HandRequests
from manipnet.control.peers import Peers
from manipnet.control.request import Handler, Request
from manipnet.control.rig_requests import RigRequests
from manipnet.control.session_requests import SessionRequests
from manipnet.inputs.sender_stats import SenderStats
from manipnet.jit import collection_paused
from manipnet.recording.open_recording import profile_key
from manipnet.recording.recorder import carried_objects
from manipnet.runtime.avatars import avatars_of
from manipnet.runtime.flight_recorder import FlightRecorder
from manipnet.runtime.mailbox import Mailbox
from manipnet.runtime.object_catalog import ObjectCatalog
from manipnet.runtime.tick_loop import TickLoop, TickObserver
from manipnet.runtime.warm_up import carry_a_hand, pose_a_hand, warm_up
from manipnet.synthesis.hand.profile import profile_to_json, read_profile
from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.objects.shape import Shape
from manipnet.synthesis.synthesizer import Synthesizer
from manipnet.telemetry import Telemetry
from manipnet.wire import HandsMessage

WARM_UP_OBJECT = "cube"
"""The object to warm up with if the rig names none."""


class Session:
    """Loads what is configured, and makes the parts of a server that need it."""

    def __init__(self, config: ServerConfig, wait_for_kernels: Callable[[], object]) -> None:
        """Raises `BundleError`, `MeshError` and `ProfileError`.

        `wait_for_kernels` is called before the first kernel of sensing.
        """
        self.config = config
        self.id = secrets.token_hex(8)
        self.telemetry = Telemetry()
        self.catalog = ObjectCatalog(config.objects, config.objects_unit)
        self.bundle = load_bundle(config.model, config.provider)
        with collection_paused():
            pose_a_hand(self.bundle, config.solver)
        wait_for_kernels()
        self.actors = list(map(self._load_actor, config.actors, start_delays_s(config.actors)))
        profiles = {actor.name: read_profile(actor.hand) for actor in config.actors if actor.hand is not None}
        avatars = {actor: Avatar(profile, self.bundle.hand) for actor, profile in profiles.items()}
        self.given_avatars = {actor: profile.name for actor, profile in profiles.items()}
        """The name of the profile that was given for an actor at the start, by the actor's name."""
        self.avatars = avatars_of(self.actors, avatars, self.telemetry)
        self._mailbox = Mailbox(self.telemetry)
        self._proxy = ActorsProxy(self.actors, self._mailbox)
        self.senders = SenderStats(self._mailbox.put)
        """Where the receivers leave frames."""
        self.peers = Peers(self.senders)
        self.telemetry.add_gauges(self.peers.gauges)
        self.telemetry.add_gauges(lambda: body_gauges(self._proxy))
        self.addresses: dict[str, str] = {}
        """The address of every socket by what it carries, once they are open."""

    def warm_up(self) -> None:
        """Run every shape through a tick loop once."""
        shapes = self.catalog.shapes() or [self.catalog.shape(WARM_UP_OBJECT)]
        warm_up(self.bundle, shapes, self.config.solver)
        carry_a_hand(self.bundle.hand, shapes[0])

    def tick_loop(self, publish: Callable[[HandsMessage], object], observer: TickObserver) -> TickLoop:
        """The loop from the mailbox to `publish`."""
        return TickLoop(
            self.id,
            self.actors,
            Synthesizer(self.bundle, self.config.solver, self.telemetry.stages.ended),
            publish,
            self._mailbox,
            FlightRecorder(self.config.dump_dir or user_log_path("manipnet", appauthor=False)),
            self.telemetry,
            observer,
            self.avatars,
        )

    def handlers(self) -> dict[str, Handler]:
        """The control requests about this session, one function per operation."""
        requests = SessionRequests(
            self.id, self.bundle, self.config.solver, self._proxy, self.catalog, self.telemetry
        ).handlers()
        hands = HandRequests(self._proxy, self.avatars, self.bundle.hand).handlers()
        calibration = CalibrationRequests(self._proxy, self.config.rig).handlers()
        rig = RigRequests(self._proxy, self.catalog, self.config.rig).handlers()
        own_hello, own_status = requests["hello"], requests["status"]

        def hello(request: Request) -> dict[str, Any]:
            return {**own_hello(request), "addresses": dict(self.addresses)}

        def status(request: Request) -> dict[str, Any]:
            profiles = self._proxy.ask(self.avatars.names)
            return {**own_status(request), "exposed": self.config.is_exposed, "hand_profiles": profiles}

        return {**requests, "hello": hello, **hands, **calibration, **rig, **self.peers.handlers(status)}

    def replace_shape(self, old: Shape, new: Shape) -> None:
        """Replace a shape in every prop between two ticks. From any thread; raises `RequestError`."""
        self._proxy.ask(lambda: [actor.reshape(old, new) for actor in self.actors])

    def recording_context(self) -> tuple[dict[str, str], list[Prop]]:
        """What a recording depends on: its metadata, and the props whose meshes it keeps. Raises `RequestError`."""
        props = self._proxy.ask(lambda: [prop for actor in self.actors for prop in actor.props])
        profiles = self._proxy.ask(self.avatars.profiles)
        metadata = {
            "session": self.id,
            "version": __version__,
            "model": self.bundle.name,
            "model_hash": self.bundle.model_hash,
            "objects": carried_objects(props),
            **{profile_key(profile.name): profile_to_json(profile) for profile in profiles},
        }
        if self.config.rig is not None:
            with suppress(OSError, UnicodeDecodeError):  # a rig file that is gone must not prevent a recording
                metadata["rig"] = self.config.rig.read_text(encoding="utf-8-sig")
        return metadata, props

    def _load_actor(self, config: ActorConfig, start_delay_s: float) -> Actor:
        shapes = [(prop.name, self.catalog.load(prop.mesh, prop.unit, prop.scale)) for prop in config.objects]
        props = [Prop(name, shape.name, shape) for name, shape in shapes]
        return Actor(config, props, self.bundle, self.telemetry, self.config.look_ahead_s, start_delay_s)
