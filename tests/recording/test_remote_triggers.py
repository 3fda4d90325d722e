"""Recordings that Motive's broadcast and OSC begin, name and end, over real sockets."""

import socket
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from live_server import LiveServer, Stage, scene, serving

from manipnet.common.options import ConfigError
from manipnet.config.settings import ServerConfig, check, default_actor
from manipnet.inputs.osc.packet import split_packet
from manipnet.inputs.osc.triggers import take_triggers
from manipnet.net.osc import osc_message
from manipnet.recording.capture_xml import MAX_BYTES, CaptureError, parse_capture
from manipnet.recording.mcap_file import read_about
from manipnet.recording.recorder import Recorder
from manipnet.recording.take_names import NAME, free_path, safe_name
from manipnet.recording.triggered import TriggeredRecordings
from manipnet.telemetry import Telemetry
from manipnet.wire.record_trigger import RecordTrigger

START = """<?xml version="1.0" encoding="UTF-8" standalone="no" ?>
<CaptureStart><Name VALUE="{name}"/><SessionName VALUE="Tuesday"/><Notes VALUE="second try &amp; last"/>
<Assets><Asset VALUE="Ann"/><Asset VALUE="Mug"/></Assets><Description VALUE=""/>
<DatabasePath VALUE="D:/Shoot/Tuesday"/><TimeCode VALUE="10:20:30:12"/><PacketID VALUE="{packet}"/>
<HostName VALUE="MOTIVE-PC"/><ProcessID VALUE="4711"/></CaptureStart>"""
STOP = """<?xml version="1.0" encoding="UTF-8"?><CaptureStop><Name VALUE="{name}"/><Notes VALUE=""/>
<TimeCode VALUE="10:21:00:00"/><PacketID VALUE="{packet}"/><HostName VALUE="MOTIVE-PC"/></CaptureStop>"""
LAUGHS = "<!DOCTYPE a [<!ENTITY a 'ha'>" + "".join(
    f"<!ENTITY {b} '{10 * f'&{a};'}'>" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)
PATIENCE_S = 20.0


def test_a_start_is_read_with_all_that_it_says() -> None:
    trigger = parse_capture(START.format(name="Take 1", packet=7).encode() + b"\0", "10.0.0.2:1512")
    assert (trigger.starts, trigger.name) == (True, "Take 1")
    assert trigger.about == {
        "notes": "second try & last",
        "timecode": "10:20:30:12",
        "assets": "Ann, Mug",
        "session_name": "Tuesday",
        "database_path": "D:/Shoot/Tuesday",
        "host_name": "MOTIVE-PC",
        "process_id": "4711",
    }
    again = parse_capture(START.format(name="Take 1", packet=7).encode(), "10.0.0.2:9999")
    assert trigger.packet == again.packet != ""
    assert not parse_capture(STOP.format(name="Take 1", packet=8).encode("utf-8"), "x:1").starts


@pytest.mark.parametrize(
    ("datagram", "reason"),
    [
        (b"", "malformed"),
        (b"\xff\xfe\x00", "malformed"),
        (b"<CaptureStart><Name VALUE='x'>", "malformed"),
        (b"<CapturePause/>", "malformed"),
        (b"<CaptureStart>" + b"<a/>" * 1000 + b"</CaptureStart>", "malformed"),
        (b"<CaptureStart><Notes VALUE='" + b"x" * MAX_BYTES + b"'/></CaptureStart>", "oversized"),
        (f"{LAUGHS}]><CaptureStart><Name>&i;</Name></CaptureStart>".encode(), "doctype"),
        (
            b"<!DOCTYPE a [<!ENTITY x SYSTEM 'file:///etc/passwd'>]><CaptureStart><Name>&x;</Name></CaptureStart>",
            "doctype",
        ),
        (b"<!DOCTYPE a SYSTEM 'http://127.0.0.1:9/a.dtd'><CaptureStart/>", "doctype"),
        (b"<?xml version='1.0' encoding='klingon'?><CaptureStart/>", "malformed"),
    ],
)
def test_what_is_no_trigger_is_refused_with_its_reason(datagram: bytes, reason: str) -> None:
    with pytest.raises(CaptureError) as refused:
        parse_capture(datagram, "x:1")
    assert refused.value.reason == reason


@given(st.binary(max_size=200))
def test_no_datagram_raises_anything_else(datagram: bytes) -> None:
    for data in (datagram, b"<CaptureStart>" + datagram, START.encode()[: len(datagram) * 3] + datagram):
        with suppress(CaptureError):
            parse_capture(data, "x:1")


@given(st.text(max_size=300))
def test_every_name_becomes_one_that_every_system_can_have(text: str) -> None:
    name = safe_name(text, Path("takes"))
    assert NAME.fullmatch(name)
    assert len(name.encode()) <= 255 - 20


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("Take 001", "Take 001"),
        ("../../etc/passwd", "_.._etc_passwd"),
        ("C:\\shoot\\a", "C_shoot_a"),
        (" walk.mcap ", "walk"),
        ("COM1", "_COM1"),
        ("Übung 日本", "Übung 日本"),
    ],
)
def test_names_are_made_safe(text: str, name: str) -> None:
    assert safe_name(text, Path("takes")) == name


def test_a_file_that_exists_is_never_chosen(tmp_path: Path) -> None:
    for expected in ("a.mcap", "a_2.mcap", "a_3.mcap"):
        path = free_path(tmp_path, "a")
        assert path.name == expected
        path.touch()


def test_osc_triggers_are_taken_out_of_a_packet() -> None:
    def read(message) -> tuple[int, list[RecordTrigger], list[str]]:
        packet, triggers = take_triggers(split_packet(message.dgram), "osc:x")
        return len(packet.messages), triggers, packet.faults

    assert read(osc_message("/record/start", "s", "Take 1")) == (0, [RecordTrigger(True, "osc:x", "Take 1")], [])
    assert read(osc_message("/record/start", "ss", "Take 1", "good"))[1][0].about == {"notes": "good"}
    assert read(osc_message("/record/stop", "")) == (0, [RecordTrigger(False, "osc:x")], [])
    assert read(osc_message("/record/start", "i", 7))[1][0].name == "7"
    assert read(osc_message("/recording/start", "s", "x"))[:2] == (1, [])


@pytest.fixture
def recordings(tmp_path: Path) -> Iterator[tuple[TriggeredRecordings, Recorder, Telemetry]]:
    telemetry = Telemetry()
    recorder = Recorder(tmp_path / "takes", lambda: ({}, []), telemetry)
    triggered = TriggeredRecordings(recorder, telemetry)
    yield triggered, recorder, telemetry
    triggered.close()
    recorder.stop()


def fates(telemetry: Telemetry) -> dict[str, int]:
    return {fate: count for fate, count in telemetry.counts()["record_triggers"].items() if count}


def test_repeated_starts_and_stops_are_harmless(recordings, tmp_path: Path) -> None:
    triggered, recorder, telemetry = recordings
    start = RecordTrigger(True, "a:1", "Take 1", packet="1")
    for trigger in (start, start, RecordTrigger(True, "a:1", "Take 1", packet="2")):
        triggered(trigger)
    for packet in ("3", "3", "4"):
        triggered(RecordTrigger(False, "a:1", "Take 1", packet=packet))
    triggered.close()
    assert fates(telemetry) == {"started": 1, "repeated": 4, "stopped": 1}
    assert recorder.finished == ["Take 1.mcap"]


def test_a_lost_stop_does_not_join_two_takes(recordings) -> None:
    triggered, recorder, _ = recordings
    for name in ("Take 1", "Take 2", "Take 1"):
        triggered(RecordTrigger(True, "a:1", name))
    triggered(RecordTrigger(False, "a:1"))
    triggered.close()
    assert recorder.finished == ["Take 1.mcap", "Take 2.mcap", "Take 1_2.mcap"]


def test_a_trigger_does_not_touch_what_a_person_records(recordings) -> None:
    triggered, recorder, telemetry = recordings
    recorder.handlers()["record"]({"name": "mine"})
    triggered(RecordTrigger(True, "a:1", "Take 1"))
    triggered(RecordTrigger(False, "a:1", "Take 1"))
    triggered.close()
    assert recorder.current() is not None
    assert fates(telemetry) == {"ignored": 2}


def test_other_machines_may_trigger_only_if_they_are_listed() -> None:
    actors = (default_actor(),)
    with pytest.raises(ConfigError, match=r"--trigger-host 0\.0\.0\.0 can be reached from other machines"):
        check(ServerConfig(actors, trigger_host="0.0.0.0"))
    check(ServerConfig(actors, trigger_host="0.0.0.0", insecure=True))


class Sending:
    """A server that records into a folder, and a UDP socket to trigger it."""

    def __init__(self, server: LiveServer, folder: Path) -> None:
        self.server, self.folder = server, folder
        self.stage = Stage(server)
        self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def send(self, where: str, datagram: bytes) -> None:
        host, port = self.server.addresses[where].removeprefix("udp://").rsplit(":", 1)
        self._udp.sendto(datagram, (host, int(port)))

    def wait(self, counter: str, label: str, count: int) -> None:
        end_s = time.monotonic() + PATIENCE_S
        while self.stage.counted(counter, label) < count:
            assert time.monotonic() < end_s, self.server.ask({"op": "status"})["counters"]

    def close(self) -> None:
        self._udp.close()
        self.stage.close()


@pytest.fixture(scope="module")
def sending(tiny_bundle: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Sending]:
    folder = tmp_path_factory.mktemp("triggered") / "takes"
    with serving("--model", str(tiny_bundle), "--mesh", "Box=cube", "--takes", str(folder)) as server:
        sending = Sending(server, folder)
        yield sending
        sending.close()


def test_motive_begins_names_and_ends_a_recording(sending: Sending) -> None:
    sending.send("trigger", START.format(name="Take 1", packet=1).encode())
    sending.wait("record_triggers", "started", 1)
    sending.stage.perform(0.5, scene)
    for _ in range(2):
        sending.send("trigger", STOP.format(name="Take 1", packet=2).encode())
    sending.wait("record_triggers", "stopped", 1)
    about = read_about(sending.folder / "Take 1.mcap")
    assert about.whole
    assert about.counts["/hands"] > 10
    assert {key: about.metadata[key] for key in ("take", "notes", "timecode", "session_name")} == {
        "take": "Take 1",
        "notes": "second try & last",
        "timecode": "10:20:30:12",
        "session_name": "Tuesday",
    }
    assert "model_hash" in about.metadata
    takes = sending.server.ask({"op": "recordings", "notes": True})["takes"]
    assert [take["note"] for take in takes if take["name"] == "Take 1.mcap"] == ["second try & last"]


def test_osc_begins_and_ends_a_recording_and_never_overwrites(sending: Sending) -> None:
    for k in (1, 2):
        started, stopped = (sending.stage.counted("record_triggers", fate) for fate in ("started", "stopped"))
        sending.send("osc", osc_message("/record/start", "s", "osc take").dgram)
        sending.wait("record_triggers", "started", started + 1)
        sending.stage.perform(0.2, scene)
        sending.send("osc", osc_message("/record/stop", "").dgram)
        sending.wait("record_triggers", "stopped", stopped + 1)
        assert len(list(sending.folder.glob("osc take*.mcap"))) == k
    assert sending.stage.counted("frames_dropped", "malformed") == 0


def test_a_malformed_trigger_costs_only_itself(sending: Sending) -> None:
    sending.send("trigger", b"<CaptureStart>")
    sending.send("trigger", f"{LAUGHS}]><CaptureStart>&i;</CaptureStart>".encode())
    sending.send("trigger", b"x" * 30_000)
    for reason in ("malformed", "doctype", "oversized"):
        sending.wait("triggers_refused", reason, 1)
    assert sending.server.ask({"op": "recordings"})["recording"] is None
