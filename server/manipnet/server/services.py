"""Everything of a server that listens or sends, and the loop between its ends."""

import logging
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Final

from manipnet.config.settings import TRIGGER_PORT, ServerConfig
from manipnet.control.dispatcher import Dispatcher
from manipnet.control.service import Control
from manipnet.inputs import make_receivers, start_receivers
from manipnet.net.curve_keys import ServerKeys
from manipnet.net.errors import ListenError
from manipnet.outputs import open_outputs
from manipnet.outputs.declaration import Emission
from manipnet.outputs.publisher import Publisher
from manipnet.page.audience import PageAndClients
from manipnet.page.supervisor import LivePage
from manipnet.recording.recorder import Recorder
from manipnet.recording.take_notes import TakeNotes
from manipnet.recording.trigger_listener import TriggerListener
from manipnet.recording.triggered import TriggeredRecordings
from manipnet.runtime.mesh_watch import MeshWatch
from manipnet.runtime.tick_loop import TickLoop
from manipnet.server.session import Session
from manipnet.synthesis.hand.hand_file import HAND_FILE
from manipnet.telemetry import Telemetry

_log = logging.getLogger(__name__)
LOOPBACK: Final = "127.0.0.1"
RECEIVERS_OPS: Final = ("hand_profile",)
"""The operations that are open to clients that only receive hands, as browsers do."""


@dataclass(frozen=True)
class Services:
    """What is open: the tick loop, and the address of every socket by what it carries."""

    loop: TickLoop
    addresses: dict[str, str]
    recorder: Recorder


def open_services(session: Session, keys: ServerKeys | None, opened: ExitStack) -> Services:
    """Open every socket; `opened` closes them in reverse order.

    Raises `ListenError`, `ConfigError` and `KeyFileError`.
    """
    config, telemetry = session.config, session.telemetry
    recorder = Recorder(config.takes, session.recording_context, telemetry)
    opened.callback(recorder.stop)
    triggers = TriggeredRecordings(recorder, telemetry)
    opened.callback(triggers.close)
    takes = TakeNotes(config.takes, recorder)
    dispatcher = Dispatcher({**session.handlers(), **recorder.handlers(), **takes.handlers()}, telemetry)
    opened.callback(dispatcher.close)

    def submit(request: bytes, reply: Callable[[bytes], object]) -> None:
        dispatcher.submit([request], reply, here=False, ops=RECEIVERS_OPS)

    emission = Emission(telemetry, session.bundle.hand, config.host, keys, session.given_avatars, submit)
    outputs = open_outputs(config.of, emission)
    publisher = Publisher(outputs, telemetry, recorder, session.given_avatars.values())
    opened.callback(publisher.close)
    meshes = MeshWatch(session.catalog, session.replace_shape)
    opened.callback(meshes.stop)
    meshes.start()
    control = Control(config.host, config.control_port, dispatcher, telemetry, keys)
    opened.callback(control.stop)
    control.start()
    page_host = LOOPBACK if keys is not None else config.host  # browsers have no keys
    page = LivePage(page_host, config.page_port, dispatcher.submit, telemetry, session.bundle.folder / HAND_FILE)
    opened.callback(page.stop)
    session.avatars.audience = PageAndClients(publisher, page)
    page.start()
    receivers = make_receivers(
        config.of, session.senders, telemetry, config.host, keys, config.allow, config.body_keys, triggers
    )
    start_receivers(receivers, opened)
    session.peers.receivers = {declared.title: receiver for declared, receiver in receivers.items()}
    session.peers.connected = lambda: {**publisher.connected(), "control": control.connected()}
    addresses = {
        **publisher.addresses,
        **{declared.title: receiver.address for declared, receiver in receivers.items()},
        "control": control.address,
        "page": page.address,
    }
    listener = _listen_for_triggers(config, triggers, telemetry)
    if listener is not None:
        opened.callback(listener.close)
        addresses["trigger"] = listener.address
    if config.metrics_port is not None:
        from manipnet.runtime.prometheus import MetricsPage  # its library is of no use to others

        metrics = MetricsPage(LOOPBACK, config.metrics_port, telemetry)
        opened.callback(metrics.close)
        addresses["metrics"] = metrics.address
    session.addresses = addresses
    return Services(session.tick_loop(publisher.publish, page), addresses, recorder)


def _listen_for_triggers(
    config: ServerConfig, triggers: TriggeredRecordings, telemetry: Telemetry
) -> TriggerListener | None:
    """The listener of Motive's triggers; None if another program, perhaps another server, has the usual port.

    Raises `ListenError` for a port that somebody has chosen.
    """
    try:
        return TriggerListener(config.trigger_host, config.trigger_port, config.allow, triggers, telemetry)
    except ListenError as error:
        if (config.trigger_host, config.trigger_port) != (LOOPBACK, TRIGGER_PORT):
            raise ListenError(f"--trigger-port: {error}") from None
        _log.info("Motive cannot trigger recordings here: %s (--trigger-port)", error)
        return None
