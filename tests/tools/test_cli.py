"""`manipnet VERB`: every verb has a help text, works, and reports an error in one line."""

import functools
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from live_server import scene
from tracked_bodies import record_scene

from manipnet.recording.mcap_file import read_about
from manipnet.synthesis.objects.library import LIBRARY_FOLDER
from manipnet.wire import SIDES
from manipnet_tools import cli
from manipnet_tools.commands.verbs import VERBS

CUBE = LIBRARY_FOLDER / "cube.ply"


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Two hands that swing a box for 1.5 s."""
    return record_scene(tmp_path / "swing.mcap", 1.5, start_s=50.0)


def error_of(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert cli.main(arguments) == 1
    return capsys.readouterr().err


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_a_help_text(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        cli.main([verb, "--help"])
    text = capsys.readouterr().out
    assert f"manipnet{'-' if verb == 'serve' else ' '}{verb}" in text
    assert "examples:" in text


def test_help_names_every_verb(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--help"]) == 0
    text = capsys.readouterr().out
    assert all(f"  {verb} " in text for verb in VERBS)
    assert "examples:" in text
    assert cli.main([]) == 2
    assert cli.main(["--version"]) == 0


HEAVY = {"matplotlib", "numba", "onnx", "onnxruntime", "ray", "scipy", "torch", "trimesh", "viser", "zmq"}
"""Libraries that take long to load."""
HELP = [[verb, "--help"] for verb in VERBS] + [["rig", "init", "--help"], ["rig", "show", "--help"]]
MISTYPED = [
    line.split()
    for line in (
        "serve --rig gone.toml",
        "serve --mesh Box=gone.obj",
        "serve --model gone",
        "replay gone --to tcp://127.0.0.1",
        "record --out gone/a.mcap",
        "replay . --keys gone.toml",
        "record --out a.mcap --rig gone.toml",
        "record --out a.mcap --keys gone.toml",
        "recover gone.mcap --out a.mcap",
        "synthesize gone --out a.npz",
        "synthesize . --out gone/a.npz",
        "synthesize . --out a.npz --mesh Box=gone.obj",
        "synthesize . --out a.npz --model gone",
        "synthesize . --out a.npz --rig gone.toml",
        "batch gone --out a",
        "batch . --out a --mesh Box=gone.obj",
        "batch . --out a --model gone",
        "export gone --format csv --out a.csv",
        "export . --format csv --out gone/a.csv",
        "export . --format gltf --out a.glb --mesh Box=gone.obj",
        "import bvh gone --out a",
        "import bvh . --mesh Box=gone.obj --out a",
        "evaluate --data gone",
        "train --data gone --out a",
        "ablate --data gone --out a",
        "quantise gone --out a",
        "bench --take gone",
        "bench --take . --mesh Box=gone.obj",
        "bench --model gone",
        "bench --beside gone",
        "bench --json gone/a.json",
        "doctor --rig gone.toml",
        "rig init gone/a.toml",
        "rig show --rig gone.toml",
        "calibrate --keys gone.toml",
        "keys --folder gone list",
    )
]


@pytest.mark.parametrize(("calls", "status"), [(HELP, 0), (MISTYPED, 1)], ids=["help", "mistyped"])
def test_help_and_mistyped_paths_load_no_slow_library(calls: list[list[str]], status: int, tmp_path: Path) -> None:
    script = f"""
import sys
from manipnet_tools import cli

for call in {calls!r}:
    try:
        status = cli.main(call)
    except SystemExit as end:
        status = end.code or 0
    loaded = sys.modules.keys() & {HEAVY!r}
    assert status == {status} and not loaded, (call, status, loaded)
    assert {status} or not sys.modules.keys() & {{"numpy", "msgpack", "rich"}}, call
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stderr
    if status:
        assert sum("gone" in line for line in (done.stdout + done.stderr).splitlines()) == len(calls)
    assert not list(tmp_path.iterdir())


def test_an_unknown_verb_is_refused_with_the_list(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["conjure"]) == 2
    assert "there is no verb 'conjure'; the verbs are serve, replay" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ("record --sever x", "manipnet record: --out is missing"),
        ("record --out a.mcap --sever x", "manipnet record: there is no option --sever; did you mean --server?"),
        ("export a --format fbx --out a.fbx", "allowed are bvh, gltf, csv; export gltf, which Blender opens and saves"),
        ("replay a --speed fast", "manipnet replay: --speed is 'fast'; it must be a number"),
        ("doctor --rigg x", "manipnet doctor: there is no option --rigg; did you mean --rig?"),
        ("keys", "manipnet keys: verb is missing"),
        ("rig shine", "manipnet rig: shine is not known here; allowed are init, show"),
        ("serve --port", "manipnet-serve: --port needs a value"),
    ],
)
def test_a_mistyped_option_is_one_line_in_every_verb(line: str, error: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        cli.main(line.split())
    text = capsys.readouterr().err
    assert error in text
    assert text.count("\n") == 1


def test_files_are_replaced_only_by_force(
    recording: Path, tiny_bundle: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """The same rule and the same sentence in every verb that writes a file."""
    out = {suffix: tmp_path / f"out.{suffix}" for suffix in ("npz", "csv", "glb", "mcap", "toml", "json")}
    for file in out.values():
        file.write_text("precious")
    model = ["--model", str(tiny_bundle)]
    verbs = {
        "npz": ["synthesize", str(recording), "--mesh", "Box=cube", *model, "--out"],
        "csv": ["export", str(recording), "--format", "csv", "--out"],
        "glb": ["export", str(recording), "--format", "gltf", "--out"],
        "mcap": ["recover", str(recording), "--out"],
        "toml": ["rig", "init"],
        "json": ["bench", "--json"],
    }
    for suffix, words in verbs.items():
        error = error_of(capsys, *words, str(out[suffix]))
        assert f"{out[suffix]}: already exists; give another name, or --force to replace it" in error
        assert out[suffix].read_text() == "precious"
    for suffix in ("npz", "mcap"):
        assert cli.main([*verbs[suffix], str(out[suffix]), "--force"]) == 0
        assert out[suffix].read_bytes() != b"precious"


def test_meshes_may_be_names_of_the_library(
    recording: Path, tiny_bundle: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out, model = str(tmp_path / "fingers.npz"), ["--model", str(tiny_bundle)]
    assert cli.main(["synthesize", str(recording), "--mesh", "Box=hammer", *model, "--out", out]) == 0
    error = error_of(capsys, "synthesize", str(recording), "--mesh", "Box=hamer", "--out", str(tmp_path / "x.npz"))
    assert "--mesh Box=hamer: hamer is neither a file nor an object of the library (did you mean hammer?)" in error
    assert "bottle" in error


def test_the_version_tells_the_licences(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--version"]) == 0
    text = capsys.readouterr().out
    assert text.startswith("manipnet ")
    assert "code: Apache-2.0" in text
    assert "models manipnet-open: Apache-2.0" in text
    (captured,) = [line for line in text.splitlines() if "CC BY-NC 4.0" in line]
    assert "manipnet-small" in captured
    assert "manipnet-open" not in captured


def test_synthesize_writes_both_hands(recording: Path, tiny_bundle: Path, tmp_path: Path) -> None:
    out = tmp_path / "fingers.npz"
    options = ["--mesh", f"Box={CUBE}", "--model", str(tiny_bundle), "--look-ahead", "0.25", "--out", str(out)]
    assert cli.main(["synthesize", str(recording), *options]) == 0
    with np.load(out) as arrays:
        time_s = arrays["time"]
        assert np.allclose(np.diff(time_s), 1 / 60)
        assert 0.0 <= time_s[0] <= 0.5 + 1e-6
        assert time_s[-1] >= 1.0
        for side in ("left", "right"):
            assert arrays[f"{side}_positions"].shape == arrays[f"{side}_raw_positions"].shape == (len(time_s), 22, 3)
            assert arrays[f"{side}_rotations"].shape == (len(time_s), 17, 4)
            assert arrays[f"{side}_distances"].shape == (len(time_s), 22)
            wrist = [scene(float(t))[f"{side}_wrist"] for t in time_s]
            assert np.allclose(arrays[f"{side}_positions"][:, 0], np.array(wrist)[:, :3], atol=2e-3)


def test_meshes_may_come_before_the_take(recording: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = str(tmp_path / "x.npz")
    assert f"--mesh Bax={CUBE}: no object is called 'Bax'; the objects are Box" in error_of(
        capsys, "synthesize", "--mesh", f"Box={CUBE}", "--mesh", f"Bax={CUBE}", str(recording), "--out", out
    )
    assert "no --mesh" in error_of(capsys, "synthesize", str(recording), "--out", out)


def test_an_error_is_one_line(
    recording: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert error_of(capsys, "replay", "gone", "--to", "tcp://127.0.0.1:1") == "manipnet replay: gone: no such take\n"
    assert "must be tcp://HOST:PORT" in error_of(capsys, "replay", str(recording), "--to", "udp://x")
    assert "already exists" in error_of(capsys, "recover", str(recording), "--out", str(recording))
    (tmp_path / "text.mcap").write_text("text")
    assert "not a recording" in error_of(
        capsys, "recover", str(tmp_path / "text.mcap"), "--out", str(tmp_path / "out.mcap")
    )
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.delitem(sys.modules, "manipnet_tools.training.train", raising=False)
    (tmp_path / "BVH" / "mug1").mkdir(parents=True)
    assert "pip install 'manipnet-live[train]'" in error_of(capsys, "train", "--data", str(tmp_path), "--out", "m")


def test_recover_repairs_a_recording(recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content = recording.read_bytes()
    recording.write_bytes(content[: len(content) * 2 // 3])
    repaired = tmp_path / "repaired.mcap"
    assert cli.main(["recover", str(recording), "--out", str(repaired)]) == 0
    assert f"{recording} was cut off or damaged; wrote {repaired}: " in capsys.readouterr().err
    assert read_about(repaired).whole


@pytest.mark.parametrize(
    ("arguments", "printed"),
    [
        ("recover RECORDING --out DEEP/r.mcap", "wrote DEEP/r.mcap: "),
        ("record --bodies-port 0 --seconds 0.1 --out DEEP/r.mcap", "so DEEP/r.mcap was not written"),
        ("synthesize RECORDING --mesh Box=CUBE --model MODEL --out DEEP/s.npz", "wrote DEEP/s.npz: "),
        ("export FINGERS --format csv --out DEEP/e.csv", "wrote DEEP/e.csv: "),
        ("batch TAKES --out OUT", "broken failed: is not a CSV export of Motive"),
    ],
)
def test_long_paths_and_brackets_are_printed_as_they_are(
    arguments: str, printed: str, recording: Path, tiny_bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    deep = tmp_path / "takes" / "[a]" / ("x" * 100) / ("y" * 100)
    deep.mkdir(parents=True)
    (deep / "broken.csv").write_text("nothing")
    joints, bones = np.zeros((2, 22, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (2, 17, 1))
    hands = {f"{side}_{name}": array for side in SIDES for name, array in (("positions", joints), ("rotations", bones))}
    np.savez(tmp_path / "fingers.npz", **{"time": np.arange(2) / 60} | hands)  # pyright: ignore[reportArgumentType]
    names = {"RECORDING": recording, "CUBE": CUBE, "MODEL": tiny_bundle, "FINGERS": tmp_path / "fingers.npz"}
    names |= {"DEEP": deep, "TAKES": tmp_path / "takes", "OUT": tmp_path / "out"}

    def filled(text: str) -> str:
        return functools.reduce(lambda text, name: text.replace(name, str(names[name])), names, text)

    status = cli.main([filled(word) for word in arguments.split()])
    (line,) = [line for line in capsys.readouterr().err.splitlines() if filled(printed) in line]
    assert status == int("batch" in arguments or "record " in arguments)
    assert "[a]" in line
