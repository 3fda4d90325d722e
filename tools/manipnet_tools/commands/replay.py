"""`manipnet replay`: streams a take to a server at the take's own rate, as a tracker would."""

import time
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from manipnet import inputs
from manipnet.common.options import ConfigError, parse_endpoint
from manipnet.geometry import Array, quat_slerp
from manipnet.inputs.playback import BodySender, Played, ZmqBodySender, looped, play
from manipnet.net.curve_keys import read_client_keys
from manipnet.runtime.signals import stop_on_signals
from manipnet.wire.bodies import BodyFrame, BodySample
from manipnet_tools.commands.options import ReplayOptions
from manipnet_tools.commands.running_server import address_of, reach
from manipnet_tools.takes.take import BodyTrack, Take, TakeError, read_take
from manipnet_tools.terminal import WARNING, open_console

RATES_HZ = (1.0, 1000.0)
SHOW_S = 0.2


def run(options: ReplayOptions) -> None:
    """Play to the end, or until stopped. Raises `TakeError`, `ConfigError` and `PlayError`."""
    take = read_take(options.take, up=options.up)
    if options.rate is not None:
        take = resample(take, options.rate)
    frames = list(take_frames(take))
    console = open_console()
    sender = connect(options.to) if options.to is not None else connect_to_server(options, console)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TextColumn("{task.fields[state]}"))
    try:
        with Progress(*columns, console=console) as progress, stop_on_signals() as stopping:
            task = progress.add_task(take.name, total=None if options.loop else len(frames), state="")
            played = play(
                looped(frames) if options.loop else frames,
                sender,
                options.speed,
                stopping,
                _occasionally(lambda so_far: progress.update(task, completed=so_far.frames, state=state(so_far))),
            )
            progress.update(task, completed=played.frames, state="")
    finally:
        sender.close()
    console.print(f"sent {state(played)}")


def connect_to_server(options: ReplayOptions, console: Console) -> BodySender:
    """The sender to the bodies port of the server that the options name.

    Raises `ConfigError` if no server answers, `KeyFileError` and `PlayError`.
    """
    _, hello = reach(options.server, options.keys, lambda text: console.print(text, style=WARNING))
    host, port = address_of("bodies", hello, options.server)
    return ZmqBodySender(host, port, keys=None if options.keys is None else read_client_keys(options.keys))


def connect(url: str) -> BodySender:
    """The sender to `SCHEME://HOST[:PORT]`, with a scheme of some input. Raises `ConfigError` and `PlayError`."""
    scheme, separator, rest = url.partition("://")
    playable = {declared.scheme or declared.name: declared for declared in inputs.INPUTS if declared.player is not None}
    declared = playable.get(scheme) if separator else None
    if declared is None or declared.player is None or declared.default_port is None:
        allowed = " or ".join(f"{scheme}://HOST:PORT" for scheme in playable)
        raise ConfigError(f"--to {url} is not an address to play to; it must be {allowed}")
    return declared.player(*parse_endpoint(rest, declared.default_port))


def state(played: Played) -> str:
    """The progress of a replay, in words."""
    late_ms = 1e3 * played.worst_late_s
    return f"{played.frames} frames, {played.rate_hz:.1f} per second, the latest {late_ms:.1f} ms late"


def take_frames(take: Take) -> Iterator[BodyFrame]:
    """The frames that a tracker would have sent for a take."""
    tracks = {name: (track.poses.tolist(), track.tracked.tolist()) for name, track in take.bodies.items()}
    for k, t_s in enumerate(take.time_s.tolist()):
        bodies = [
            BodySample(None, name, tuple(poses[k][:3]), tuple(poses[k][3:]), tracked[k])
            for name, (poses, tracked) in tracks.items()
        ]
        timecode = None if take.timecode is None else take.timecode.texts[k] or None
        rate = None if take.timecode is None else take.timecode.rate
        yield BodyFrame(t_s, k, tuple(bodies), t_s, f"take:{take.name}", timecode, rate)


def resample(take: Take, rate_hz: float) -> Take:
    """The take at another rate, without its fingers.

    Positions are interpolated linearly and rotations spherically; a body is tracked where both neighbours are.
    """
    if not RATES_HZ[0] <= rate_hz <= RATES_HZ[1]:
        raise TakeError(f"--rate is {rate_hz:g} Hz; allowed are {RATES_HZ[0]:g} to {RATES_HZ[1]:g} Hz")
    begin_s, end_s = take.time_s[0], take.time_s[-1]
    time_s = begin_s + np.arange(int((end_s - begin_s) * rate_hz + 1e-6) + 1) / rate_hz
    before = np.clip(np.searchsorted(take.time_s, time_s, side="right") - 1, 0, max(len(take.time_s) - 2, 0))
    after = np.minimum(before + 1, len(take.time_s) - 1)
    gap_s = np.where(after > before, take.time_s[after] - take.time_s[before], 1.0)
    share = np.clip((time_s - take.time_s[before]) / gap_s, 0.0, 1.0)
    bodies = {name: _between(track, before, after, share) for name, track in take.bodies.items()}
    timecode = None if take.timecode is None else take.timecode.at(take.time_s, time_s)
    return Take(take.name, rate_hz, time_s, bodies, timecode=timecode)


def _between(track: BodyTrack, before: NDArray[np.intp], after: NDArray[np.intp], share: Array) -> BodyTrack:
    a, b = track.poses[before], track.poses[after]
    p = a[:, :3] + share[:, None] * (b[:, :3] - a[:, :3])
    q = quat_slerp(a[:, 3:], b[:, 3:], share)
    tracked = (track.tracked[before] | (share == 1.0)) & (track.tracked[after] | (share == 0.0))
    return BodyTrack(np.concatenate([p, q], axis=1), tracked)


def _occasionally(show: Callable[[Played], None]) -> Callable[[Played], None]:
    """Call `show` only a few times a second, because drawing must not delay frames."""
    shown_s = float("-inf")

    def shown(played: Played) -> None:
        nonlocal shown_s
        now_s = time.monotonic()
        if now_s - shown_s >= SHOW_S:
            shown_s = now_s
            show(played)

    return shown
