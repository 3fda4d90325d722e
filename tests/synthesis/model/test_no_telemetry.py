"""ONNX Runtime reports nothing to its maker: loading a model leaves neither an identity nor queued events."""

import os
import subprocess
import sys
from pathlib import Path

LOAD = "import sys; from manipnet import load_bundle; load_bundle(sys.argv[1])"


def test_loading_a_model_writes_nothing_for_others(tiny_bundle: Path, tmp_path: Path) -> None:
    homes = ("HOME", "USERPROFILE", "LOCALAPPDATA", "APPDATA", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME")
    environment = {name: text for name, text in os.environ.items() if name != "ORT_DISABLE_TELEMETRY"}
    environment |= {name: str(tmp_path) for name in homes}
    subprocess.run([sys.executable, "-c", LOAD, str(tiny_bundle)], env=environment, check=True)
    left = [file for file in tmp_path.rglob("*") if "onnxruntime" in file.name.lower() or file.name == "deviceid"]
    assert left == []
