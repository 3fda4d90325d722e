"""Runs everything once before a client waits for it: compiled code, the network's memory, the first allocations."""

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from manipnet.actors.actor import Actor
from manipnet.actors.props import Prop
from manipnet.config.settings import default_actor
from manipnet.runtime.flight_recorder import FlightRecorder
from manipnet.runtime.mailbox import Mailbox
from manipnet.runtime.tick_loop import TickLoop
from manipnet.synthesis.carrying import HandCarrier
from manipnet.synthesis.hand.avatar import avatar_hand
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.model_profile import model_profile
from manipnet.synthesis.ik.pose import allocate_poses, pose_kernel
from manipnet.synthesis.ik.solvers import DEFAULT_SOLVER
from manipnet.synthesis.model.bundle import Bundle
from manipnet.synthesis.objects.shape import Shape, load_shape
from manipnet.synthesis.synthesizer import HandScene, Synthesizer, windows_of
from manipnet.telemetry import Telemetry
from manipnet.wire import encode_binary, encode_msgpack
from manipnet.wire.bodies import BodyFrame, BodySample

FRAMES: Final = 120
"""Frames of one second, in which two hands at a prop make about thirty ticks."""
LOOK_AHEAD_S: Final = 0.4
"""Less than the window needs, so that something has to be forecast."""


def warm_up(bundle: Bundle, shapes: Sequence[Shape], solver: str = DEFAULT_SOLVER) -> None:
    """Synthesise two hands at each shape for half a second, in a loop like the real one whose messages go nowhere."""
    for shape in shapes:
        telemetry = Telemetry()
        mailbox = Mailbox(telemetry)
        actor = Actor(default_actor(), [Prop("prop", shape.name, shape)], bundle, telemetry, LOOK_AHEAD_S)
        actor.carry("prop", shape.name, shape, 1.0)
        loop = TickLoop(
            "warm-up",
            [actor],
            Synthesizer(bundle, solver, telemetry.stages.ended),
            lambda message: (encode_msgpack(message), encode_binary(message)),
            mailbox,
            FlightRecorder(Path(tempfile.gettempdir())),
            telemetry,
        )
        start_s = time.monotonic()
        for i in range(FRAMES):
            t_s = i / FRAMES
            mailbox.put(_frame(t_s, start_s + t_s))
            loop.take_in(0.0)
            while loop.step(start_s + t_s):
                pass


def pose_a_hand(bundle: Bundle, solver: str = DEFAULT_SOLVER) -> None:
    """Decode and solve one pose: at a first start this process compiles the solver, while another compiles the rest."""
    shape, still = load_shape("cube"), np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (21, 1))
    windows = windows_of([HandScene("right", still, still, still, shape)])
    hand, layout, before = bundle.hand, bundle.layout, bundle.rest_angles[None]
    outputs = bundle.infer(np.zeros((1, layout.input_size), np.float32))
    poses = allocate_poses(hand, 1)
    poses.correction[:] = 0.0
    network = outputs, before, bundle.response, bundle.limits
    pose_kernel(solver)(hand.packed, layout.output_starts, shape.solid, windows, *network, 0, 1, poses)


def carry_a_hand(hand: Hand, shape: Shape) -> None:
    """Solve the model's own hand as if it were an avatar's, which compiles what an avatar needs."""
    still = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    carrier = HandCarrier(avatar_hand(model_profile(hand, "left"), "left", hand), hand, "left")
    carrier.step(np.zeros(hand.angle_count), still, (shape, still, 1.0))


def _frame(t_s: float, now_s: float) -> BodyFrame:
    tremor = 0.002 * float(np.sin(1e5 * t_s))  # enough for the bodies to be smoothed
    swing = 0.02 * float(np.sin(2.0 * np.pi * t_s)) + tremor
    bodies = (
        BodySample(None, "left_wrist", (0.15, swing, 0.05), (0.0, 0.0, 0.0, 1.0), True),
        BodySample(None, "right_wrist", (-0.15, -swing, 0.05), (0.0, 0.0, 0.0, 1.0), True),
        BodySample(None, "prop", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), True),
    )
    return BodyFrame(t_s, None, bodies, now_s, "zmq:warm-up")
