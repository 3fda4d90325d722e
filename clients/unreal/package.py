"""Write the plugin as a zip for each engine version, whose descriptor names that version.

`python clients/unreal/package.py [--out FOLDER]`. The checkout's own descriptor names no version, so that it builds
with every engine from 5.3 on; a descriptor that names another one makes the editor ask at each start.
"""

import argparse
import json
import zipfile
from pathlib import Path

PLUGIN = Path(__file__).parent / "ManipNetLiveLink"
ENGINES = ("5.3", "5.4", "5.5", "5.6")


def write(engine: str, folder: Path) -> Path:
    """Write the zip for an engine version; it unpacks to the folder `ManipNetLiveLink`."""
    descriptor = json.loads((PLUGIN / "ManipNetLiveLink.uplugin").read_text(encoding="utf-8"))
    named = {"FileVersion": descriptor.pop("FileVersion"), "EngineVersion": f"{engine}.0", **descriptor}
    path = folder / f"ManipNetLiveLink-{descriptor['VersionName']}-ue{engine}.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(PLUGIN.rglob("*")):
            name = file.relative_to(PLUGIN.parent).as_posix()
            if file.suffix == ".uplugin":
                archive.writestr(name, json.dumps(named, indent=4) + "\n")
            elif file.is_file() and "Intermediate" not in file.parts and "Binaries" not in file.parts:
                archive.write(file, name)
    return path


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("dist"), help="where the zips are written")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    for version in ENGINES:
        print(write(version, out))
