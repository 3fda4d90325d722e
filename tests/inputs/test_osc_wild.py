"""A real server and OSC senders as people have them: odd clocks, foreign messages, changes only, other addresses."""

import itertools
import math
import threading
import time
from collections.abc import Iterator

import pytest
from live_server import LiveServer, serving
from osc_streams import HZ, bodies, bridge, float64, milliseconds, ntp, poses, raw, stream, vmc
from osc_writer import bundle, osc

RIG = """
[[actors]]
name = "ids"
bodies = { left_wrist = 1, right_wrist = 2 }
[[actors.objects]]
body = 3
mesh = "cube"

[[actors]]
name = "bones"
bodies = { left_wrist = "Ann:9", right_wrist = "Ann:13" }

[[actors]]
name = "vrchat"
bodies = { left_wrist = "leftwrist", right_wrist = "rightwrist" }

[[actors]]
name = "names"
bodies = { left_wrist = "左手", right_wrist = "Hand/right" }
[[actors.objects]]
body = "stage"
mesh = "cube"

[server]
look_ahead = 0.1
[[server.osc_address]]
address = "/stage/<body>"
arguments = "qw qx qy qz x y z"
axes = "z-up"
unit = "mm"
"""
SECONDS = 1.6


@pytest.fixture(scope="module")
def server(tiny_bundle, tmp_path_factory) -> Iterator[LiveServer]:
    rig = tmp_path_factory.mktemp("rig") / "rig.toml"
    rig.write_text(RIG, encoding="utf-8")
    with serving("--rig", str(rig), "--model", str(tiny_bundle)) as server:
        yield server


class Outcome:
    """What became of a stream: the part of its frames that was used, and the server's status in its second half."""

    def __init__(self, server: LiveServer, frame, seconds: float = SECONDS, hz: float = HZ) -> None:
        before = _counts(server)
        port = int(server.addresses["osc"].rpartition(":")[2])
        sent: list[int] = []
        sending = threading.Thread(target=lambda: sent.append(stream(port, frame, seconds, hz)))
        begin_s = time.monotonic()
        sending.start()
        self.statuses = []
        while sending.is_alive():
            status = server.ask({"op": "status"})
            if time.monotonic() - begin_s > 0.5 * seconds and sending.is_alive():
                self.statuses.append(status)
            sending.join(0.1)
        after = _counts(server)
        self.used = (after["in"] - before["in"] - after["dropped"] + before["dropped"]) / sent[0]
        self.status = self.statuses[-1]

    def states(self, actor: str) -> set[tuple[str, ...]]:
        """The states of the actor's bodies, in the order of the rig, at different times."""
        bodies = (status["actors"][actor]["bodies"].values() for status in self.statuses)
        return {tuple(body["state"] for body in each) for each in bodies}

    @property
    def sender(self) -> dict:
        return list(self.status["osc"]["senders"].values())[-1]


def _counts(server: LiveServer) -> dict[str, int]:
    """How many frames have arrived, and how many were dropped because of what they contain."""
    counters = server.ask({"op": "status"})["counters"]
    # At first, the bodies still belong to the sender of the test before.
    reasons = counters.get("frames_dropped", {})
    dropped = sum(count for reason, count in reasons.items() if reason not in ("malformed", "other_sender"))
    return {"in": counters.get("frames_in", {}).get("osc", 0), "dropped": dropped}


class Changes:
    """Sends each value only if it differs from the one before."""

    def __init__(self, *words: str, still: int | None = None) -> None:
        self._words, self._still, self._last = words or ("position", "quat"), still, {}

    def __call__(self, k: int) -> list[bytes]:
        messages = []
        for i, p in bodies(0 if self._still is None else k):
            moving = bodies(k)[i - 1][1] if i != self._still else bodies(0)[i - 1][1]
            for word, value in (("position", moving[:3]), ("quat", p[3:] if "quat" in self._words else moving[3:])):
                if self._last.get((i, word)) != value:
                    self._last[i, word] = value
                    messages.append(osc(f"/rigidbody/{i}/{word}", *value))
        return [bundle(*messages)]


def stamped(k, milliseconds):
    """The bridge's messages with another time."""
    return [*bridge(k)[:1], osc("/frame/timestamp", milliseconds), *bridge(k)[2:]]


def sparck(k):
    messages = [m for i, p in bodies(k) for m in (osc("/rb", i, 0, 1), osc("/rb", i, 2, milliseconds(k), *p))]
    return [bundle(osc("/f/s", k), osc("/f/t", milliseconds(k)), *messages, osc("/f/e", k))]


def max_mode(k):
    messages = [
        osc("/rigidbody", i, word, *value)
        for i, p in bodies(k)
        for word, value in (("tracked", (1,)), ("position", p[:3]), ("quat", p[3:]), ("matrix", (0.0,) * 16))
    ]
    return [osc("/frame/start", k), osc("/frame/timestamp", milliseconds(k)), *messages, osc("/frame/end", k)]


def isadora(k):
    messages = [
        osc(f"/rigidbody/{i}/{word}", *value)
        for i, p in bodies(k)
        for word, value in (("tracked", (1,)), ("position", p[:3]), ("quat", p[3:]))
    ]
    return [osc("/frame/start", k), osc("/frame/timestamp", milliseconds(k)), *messages, osc("/frame/end", k)]


def vmt(axes):
    return lambda k: [bundle(*(osc(f"/VMT/Room/{axes}", i, 1, 0.0, *p) for i, p in bodies(k)))]


def bone_parts(k, *, in_address):
    """Two bones as the bridge sends them in its modes for Isadora and for Max, beside a rigid body."""
    messages = []
    for bone, p in zip((9, 13), poses(k), strict=False):
        for word, value in (("position", p[:3]), ("quat", p[3:])):
            if in_address:
                messages.append(osc(f"/skeleton/Ann/bone/{bone}/{word}", *value))
            else:
                messages.append(osc("/skeleton/bone", "Ann", bone, word, *value))
    return [bundle(*bridge(k, *messages))]


def bones(k):
    left, right, _ = poses(k)
    whole = [osc(f"/skeleton/Ann/bone/{bone}/transformation", *p) for bone, p in ((9, left), (13, right))]
    return [bundle(osc("/frame/start", k), osc("/frame/timestamp", milliseconds(k)), *whole, osc("/frame/end", k))]


def sparck_bones(k):
    left, right, _ = poses(k)
    named = [osc("/motive/skeleton/id", "Ann", 5)] if k % 60 == 0 else []
    whole = [osc("/skel", 5, bone, milliseconds(k) + 0.5, *p) for bone, p in ((9, left), (13, right))]
    return [*named, bundle(osc("/f/s", k), osc("/f/t", milliseconds(k)), *whole, osc("/f/e", k))]


def vrsystem(k):
    return [
        osc(f"/tracking/vrsystem/{name}/pose", *p[:3], 0.0, 90.0, 0.0)
        for name, p in zip(("leftwrist", "rightwrist"), poses(k), strict=False)
    ]


def rotations_later(k):
    """Positions and rotations in datagrams of their own, in turn."""
    half = k // 2
    word, value = ("position", lambda p: p[:3]) if k % 2 == 0 else ("rotation", lambda p: (10.0 * p[0], 20.0, 30.0))
    return [bundle(*(osc(f"/tracking/trackers/{i}/{word}", *value(p)) for i, p in bodies(half, HZ / 2)))]


def of_another_encoding(k):
    left, right, prop = poses(k)
    names = ("左手".encode("shift_jis"), b"Hand/right", b"stage")
    return [
        bundle(
            osc("/frame/start", k),
            osc("/frame/timestamp", milliseconds(k)),
            *(
                raw(b"/VMC/Ext/Tra/Pos", b",s" + b"d" * 7, name + bytes(4 - len(name) % 4) + b"".join(map(float64, p)))
                for name, p in zip(names, (left, right, prop), strict=True)
            ),
            osc("/frame/end", k),
        )
    ]


def declared(k):
    left, right, (x, y, z, qx, qy, qz, qw) = poses(k)
    wrists = [osc("/VMC/Ext/Tra/Pos", name, *p) for name, p in (("左手", left), ("Hand/right", right))]
    prop = osc("/stage/stage", qw, qx, -qz, qy, 1e3 * x, -1e3 * z, 1e3 * y)
    return [bundle(osc("/VMC/Ext/T", k / HZ), *wrists, prop)]


FOREIGN = {
    "text in Shift-JIS": osc("/VMC/Ext/Blend/Val", 1.0)[:20]
    + b",sf\0"
    + "あ".encode("shift_jis")
    + bytes(2)
    + bytes(4),
    "an address with a pattern": osc("/tool/*/x".replace("*", "a"), 1.0).replace(b"/tool/a", b"/tool/*"),
    "an address in Latin-1": raw(b"/t\xfcr", b",f", bytes(4)),
    "an address of 600 characters": raw(b"/" + b"x" * 599, b",f", bytes(4)),
    "seventy numbers": osc("/tool/shapes", *[0.0] * 70),
    "a type that nobody knows": raw(b"/tool/x", b",u", bytes(4)),
    "no type tags": raw(b"/tool/x", b"text"),
    "an argument that is cut off": raw(b"/tool/x", b",fff", bytes(4)),
    "an element of 6 bytes": b"/tool\0",
    "an element that is no message": b"tool\0\0\0\0",
    "a bundle in bundles in bundles": bundle(bundle(bundle(bundle(bundle(osc("/tool/x", 1.0)))))),
    "a wrong message about a body": osc("/VMC/Ext/Tra/Pos", "77", 1.0, 2.0),
    "a body whose id is too large": osc("/rigidbody/99999999999/position", 1.0, 2.0, 3.0),
    "a body with NaN": osc("/VMC/Ext/Tra/Pos", "77", *[math.nan] * 7),
}

LIVE = {
    "a plain bridge": ("ids", lambda k: bridge(k)),
    "milliseconds as a time tag": ("ids", lambda k: [bundle(*bridge(k), tag=milliseconds(k))]),
    "a time tag of 0": ("ids", lambda k: [vmc(k, 0)]),
    "a time tag of whole seconds": ("ids", lambda k: [vmc(k, (int(time.time()) + 2_208_988_800) << 32)]),
    "a constant time tag": ("ids", lambda k: [vmc(k, ntp(1e9 + 0.25))]),
    "a time tag that is an hour off, but runs": ("ids", lambda k: [vmc(k, ntp(1_767_225_600.0 + k / HZ))]),
    "a time tag of 1900 in nanoseconds": ("ids", lambda k: [vmc(k, k * 8_333_333 + 5)]),
    "a /frame/timestamp in seconds": (
        "ids",
        lambda k: stamped(k, k / HZ),
    ),
    "a /frame/timestamp of zero": ("ids", lambda k: stamped(k, 0)),
    "a /frame/timestamp that wraps around at midnight": (
        "ids",
        lambda k: stamped(k, (86_399_400 + 1000 * k // HZ) % 86_400_000),
    ),
    **{f"{name} in the bundle": ("ids", lambda k, odd=odd: [vmc(k, extra=[odd])]) for name, odd in FOREIGN.items()},
    **{
        f"{name} in a datagram": ("ids", lambda k, odd=odd: [odd, vmc(k)])
        for name, odd in FOREIGN.items()
        if len(odd) % 4 == 0
    },
    "positions that change, rotations that do not": ("ids", Changes("position")),
    "a prop that does not change at all": ("ids", Changes("position", "quat", still=3)),
    "three frames at a time": ("ids", lambda k: [] if k % 3 < 2 else [vmc(j) for j in (k - 2, k - 1, k)]),
    "three frames at a time without a clock": (
        "ids",
        lambda k: [] if k % 3 < 2 else [vmt("Unity")(j)[0] for j in (k - 2, k - 1, k)],
    ),
    "the time in a datagram of its own": (
        "ids",
        lambda k: [osc("/VMC/Ext/T", k / HZ), bundle(*(osc("/VMC/Ext/Tra/Pos", str(i), *p) for i, p in bodies(k)))],
    ),
    "the bridge's mode for Max": ("ids", max_mode),
    "the bridge's mode for Isadora": ("ids", isadora),
    "the bridge's modes for Max and TouchDesigner at once": (
        "ids",
        lambda k: bridge(k, *max_mode(k)[2:-1]),
    ),
    "the bridge's mode for SPARCK": ("ids", sparck),
    "the bridge's mode for SPARCK, loose": (
        "ids",
        lambda k: list(_elements(sparck(k)[0])),
    ),
    "Virtual Motion Tracker in Unity's axes": ("ids", vmt("Unity")),
    "Virtual Motion Tracker in the driver's axes": ("ids", vmt("Driver")),
    "VRChat's rotations in datagrams of their own": ("ids", rotations_later),
    "VRChat's wrists": ("vrchat", vrsystem),
    "bones in the bridge's mode for TouchDesigner": ("bones", bones),
    "bones in the bridge's mode for Isadora": ("bones", lambda k: bone_parts(k, in_address=True)),
    "bones in the bridge's mode for Max": ("bones", lambda k: bone_parts(k, in_address=False)),
    "bones in the bridge's mode for SPARCK": ("bones", sparck_bones),
    "names in another encoding, with a slash, and doubles": ("names", of_another_encoding),
    "an address that the rig declares": ("names", declared),
}


def _elements(data):
    at = 16
    while at < len(data):
        size = int.from_bytes(data[at : at + 4], "big")
        yield data[at + 4 : at + 4 + size]
        at += 4 + size


@pytest.mark.parametrize("name", LIVE)
def test_hands_are_live(server, name):
    actor, frame = LIVE[name]
    outcome = Outcome(server, frame)
    bodies = len(outcome.status["actors"][actor]["bodies"])
    assert ("live",) * bodies in outcome.states(actor), (outcome.used, outcome.status["actors"][actor], outcome.sender)
    expected = 0.5 if "datagrams of their own" in name else 1.0
    assert outcome.used > 0.9 * expected


def test_a_body_that_is_declared_lost_once_stays_lost(server):
    def frame(k):
        lost = [osc("/rigidbody/2/tracked", 0)] if k == HZ // 2 else []
        return [bundle(*lost, *(osc(f"/rigidbody/{i}/transformation", *p) for i, p in bodies(k)))]

    outcome = Outcome(server, frame, 3.0)
    assert ("live", "rest", "live") in outcome.states("ids")


def test_two_bodies_with_one_id_are_refused_by_name_and_the_others_work(server):
    def frame(k):
        far = (2.0, 1.0, 2.0 + 0.01 * math.sin(k), 0.0, 0.0, 0.0, 1.0)
        return [vmc(k, extra=[osc("/VMC/Ext/Tra/Pos", "3", *far)])]

    outcome = Outcome(server, frame, 3.0)
    assert ("live", "live", "rest") in outcome.states("ids")
    assert outcome.sender["conflicts"] == ["3"]
    assert outcome.status["counters"]["bodies_rejected"]["conflict"] > 100


def test_what_is_not_understood_is_named_with_its_count(server):
    outcome = Outcome(server, lambda k: [osc("/light/7/colour", 1.0, 0.5), osc("/rigidbody/9/position", 1.0, 2.0, 3.0)])
    ignored = outcome.status["osc"]["not_understood"]["/light/7/colour"]
    assert ignored["count"] > 0.8 * SECONDS * HZ
    assert ignored["rate_hz"] == pytest.approx(HZ, rel=0.2)
    assert ignored["age_s"] < 1.0
    assert outcome.sender["halves"] == {"9": "rotation"}


def test_addresses_that_are_made_up_do_not_pile_up(server):
    numbers = itertools.count()
    outcome = Outcome(server, lambda k: [osc(f"/noise/{next(numbers)}", 1.0) for _ in range(3)])
    ignored = outcome.status["osc"]["not_understood"]
    assert len(ignored) <= 65
    assert ignored["other addresses"]["count"] > 100


def test_the_clock_in_use_and_those_set_aside_are_reported(server):
    outcome = Outcome(server, lambda k: [bundle(*bridge(k), tag=milliseconds(k))])
    assert outcome.sender["clock"]["used"] == "/frame/timestamp"
    assert "time tag" in outcome.sender["clock"]["set_aside"]


def test_a_clock_that_stops_in_between_costs_little(server):
    stamp = 5_400_000

    def frame(k):
        nonlocal stamp
        stamp = milliseconds(k) if not HZ <= k < 2 * HZ else stamp
        return stamped(k, stamp)

    outcome = Outcome(server, frame, 4.0)
    assert ("live",) * 3 in outcome.states("ids")
    assert outcome.used > 0.8, "0.98 without other load: test_osc_assembler"
