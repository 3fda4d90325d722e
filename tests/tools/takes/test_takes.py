"""Takes from every kind of file: small ones written here, in each format's own units and handedness."""

from pathlib import Path

import numpy as np
import pytest

from manipnet.geometry import quat_rotate
from manipnet.recording.mcap_file import RecordingWriter
from manipnet.wire.bodies import BodyFrame, BodySample
from manipnet_tools.takes.take import Take, TakeError, read_take

HALF = 0.5**0.5
ABOUT_X = "0.7071068,0,0,0.7071068"
"""A quarter turn about x; about x a left-handed file turns as ours does, about y and z the other way."""
ABOUT_Y = "0,0.7071068,0,0.7071068"


def trajectory(tmp_path: Path, text: str) -> Take:
    path = tmp_path / "motion.txt"
    path.write_text(text)
    return read_take(path)


def test_a_trajectory_is_left_handed_decimetres(tmp_path: Path) -> None:
    row = f"{ABOUT_X},1,2,3,{ABOUT_Y},-1,0,0,0,0,0,1,4,5,6\n"
    take = trajectory(tmp_path, "120\n" + 3 * row)
    assert (take.name, take.rate_hz, take.objects, take.box_centred) == ("motion", 120.0, ("object",), True)
    assert np.allclose(take.time_s, np.arange(3) / 120)
    assert np.allclose(take.bodies["object"].poses, [-0.1, 0.2, 0.3, HALF, 0.0, 0.0, HALF])
    assert np.allclose(take.bodies["left_wrist"].poses[1], [0.1, 0.0, 0.0, 0.0, -HALF, 0.0, HALF])
    assert np.allclose(take.bodies["right_wrist"].poses[2], [-0.4, 0.5, 0.6, 0.0, 0.0, 0.0, 1.0])
    assert take.bodies["object"].tracked.all()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "motion.txt:1: '' is not a rate"),
        ("fast\n1,2\n", "motion.txt:1: 'fast' is not a rate"),
        ("120\n", "has no frames"),
        ("120\n1,2,3\n", "motion.txt:2: 3 values; a frame must have 21"),
        ("120\n" + "1," * 20 + "x\n", "motion.txt:2: could not convert"),
        ("120\n" + "1," * 20 + "nan\n", "motion.txt:2: a value is not finite"),
        ("120\n" + "0," * 20 + "0\n", "object has a zero quaternion"),
    ],
)
def test_a_bad_trajectory_is_refused_with_the_place(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises(TakeError, match=complaint.replace(".", r"\.")):
        trajectory(tmp_path, text)


def motive_csv(tmp_path: Path, rows: list[str], rotation: str = "Quaternion", units: str = "Meters") -> Take:
    turn = ["X", "Y", "Z", "W"] if rotation == "Quaternion" else ["X", "Y", "Z"]
    width = len(turn) + 4
    names = ["LeftWrist", "right wrist", "Box"]
    head = [
        f"Format Version,1.23,Take Name,take,Capture Frame Rate,240.0,Export Frame Rate,120.0,Rotation Type,{rotation},"
        f"Length Units,{units},Coordinate Space,Global",
        "",
        ",Type" + f",{','.join(width * ['Rigid Body'])}" * 3 + ",Marker,Marker,Marker",
        ",Name," + ",".join(",".join(width * [name]) for name in names) + ",Box:1,Box:1,Box:1",
        ",ID," + ",".join(3 * width * ["1"]) + ",2,2,2",
        ","
        + ("," + ",".join(len(turn) * ["Rotation"] + 3 * ["Position"] + ["Mean Marker Error"])) * 3
        + 3 * ",Position",
        "Frame,Time (Seconds)" + ("," + ",".join([*turn, "X", "Y", "Z", ""])) * 3 + ",X,Y,Z",
    ]
    path = tmp_path / "motive.csv"
    path.write_text("\r\n".join([*head, *rows]) + "\r\n")
    return read_take(path)


def test_a_motive_csv_in_metres_with_a_lost_body(tmp_path: Path) -> None:
    seen = "0,0,0,1,1,2,3,0.001"
    rows = [
        f"10,0.083,{seen},{ABOUT_X},0,0,0,0.1,,,,,,,,,9,9,9",
        f"11,0.092,{seen},,,,,,,,,0,0,2,0,4,5,6,0.1,,,",
        f"12,0.100,{seen},{ABOUT_X},0,0,1,0.1,,,,,,,,,9,9,9",
    ]
    take = motive_csv(tmp_path, rows)
    assert list(take.bodies) == ["left_wrist", "right_wrist", "Box"]
    assert (take.rate_hz, take.objects, take.box_centred) == (120.0, ("Box",), False)
    assert np.allclose(take.time_s, np.arange(3) / 120)
    assert take.bodies["right_wrist"].tracked.tolist() == [True, False, True]
    assert take.bodies["right_wrist"].poses[:, 2].tolist() == [0.0, 0.0, 1.0]
    assert take.bodies["Box"].tracked.tolist() == [False, True, False]
    assert np.allclose(take.bodies["Box"].poses, [4.0, 5.0, 6.0, 0.0, 0.0, 1.0, 0.0])


def test_a_motive_csv_in_millimetres_with_euler_angles(tmp_path: Path) -> None:
    body = "90,90,0,1000,2000,-3000,0.1"
    take = motive_csv(tmp_path, [f"0,0.0,{body},{body},{body},1,1,1"], "XYZ", "Millimeters")
    pose = take.bodies["Box"].poses[0]
    assert np.allclose(pose[:3], [1.0, 2.0, -3.0])
    # A turn about x moves the body's y axis to z; the turn about that then moves its z axis to the world's x.
    assert np.allclose(quat_rotate(pose[3:], np.array([0.0, 0.0, 1.0])), [1.0, 0.0, 0.0])
    assert np.allclose(quat_rotate(pose[3:], np.array([0.0, 1.0, 0.0])), [0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("Format Version", "Something", "is not a CSV export of Motive"),
        ("Meters", "Furlongs", "Length Units is 'Furlongs'; allowed are meters"),
        ("Rigid Body", "Force Plate", "has no rigid body or bone with rotation and position, only Force Plate"),
        ("Rate,120.0", "Rate,often", "Export Frame Rate is 'often'"),
        ("Space,Global", "Space,Local", "export it as Global"),
        ("Type,Quaternion", "Type,Axis Angle", "of the type Axis Angle; export Quaternion or XYZ"),
        ("1,1,2,3", "1,one,2,3", "line 8, cell 7: 'one' is not a number"),
    ],
)
def test_a_bad_motive_csv_is_refused_with_the_remedy(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    body = "0,0,0,1,1,2,3,0"
    motive_csv(tmp_path, [f"0,0.0,{body},{body},{body},1,1,1"])
    path = tmp_path / "motive.csv"
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(TakeError, match=complaint):
        read_take(path)


def test_a_recording_is_a_take(tmp_path: Path) -> None:
    path = tmp_path / "stage.mcap"
    with RecordingWriter(path, {}) as writer:
        for k, t_s in enumerate([500.0, *(7.0 + i / 100 for i in range(50))]):
            lost = 10 <= k < 20
            wrist = BodySample(None, "left_wrist", (k / 100, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), not lost)
            box = BodySample(12, None, (0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0), True)
            writer.write_bodies(BodyFrame(t_s, k, (wrist, box), 0.0, "test"), k * 10_000_000)
    take = read_take(path)
    assert (take.name, take.rate_hz, take.objects) == ("stage", 100.0, ("12",))
    assert np.allclose(take.time_s, np.arange(50) / 100)
    track = take.bodies["left_wrist"]
    assert np.flatnonzero(~track.tracked).tolist() == list(range(9, 19))
    assert np.allclose(track.poses[9:19, 0], 0.09)
    assert np.allclose(track.poses[19:, 0], np.arange(20, 51) / 100)


def test_other_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(TakeError, match="no such take"):
        read_take(tmp_path / "gone.csv")
    (tmp_path / "a.fbx").touch()
    with pytest.raises(TakeError, match=r"allowed are a folder of BVH files, \.txt, \.csv, \.mcap"):
        read_take(tmp_path / "a.fbx")
    (tmp_path / "a.mcap").write_bytes(b"?")
    with pytest.raises(TakeError, match="not a recording"):
        read_take(tmp_path / "a.mcap")


def test_a_published_trajectory(manipnet_data: Path) -> None:
    take = read_take(manipnet_data / "Trajectories" / "demo1.txt")
    captured = read_take(manipnet_data / "BVH" / "cyl_med3")
    assert (take.rate_hz, len(take.time_s)) == (120.0, 8000)
    for name in ("left_wrist", "right_wrist"):
        reach = np.linalg.norm(take.bodies[name].poses[:, :3] - take.bodies["object"].poses[:, :3], axis=1)
        assert 0.09 < np.percentile(reach, 5) < 0.2  # a wrist at the grasp, in metres
        speed = np.linalg.norm(np.diff(take.bodies[name].poses[:, :3], axis=0), axis=1) * 120
        assert np.median(speed) < 4 * np.median(
            np.linalg.norm(np.diff(captured.bodies[name].poses[:, :3], axis=0), axis=1) * 120
        )
