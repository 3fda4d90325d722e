"""Build the Blender extension: its own files and a copy of the Python client, since Blender installs no dependencies.

`python clients/blender/package.py` writes `dist/manipnet_live-VERSION.zip`, to be installed from disk in Blender.
`python clients/blender/package.py --unpacked FOLDER` writes the same files to `FOLDER/manipnet_live` instead, for
development; running it again updates them.
"""

import argparse
import shutil
import tomllib
import zipfile
from pathlib import Path

EXTENSION = Path(__file__).parent / "manipnet_live"
CLIENT = Path(__file__).parents[1] / "python" / "manipnet_client"


def files() -> dict[str, Path]:
    """Every file of the extension: its path inside the extension, and the file that it is copied from."""
    own = {path.name: path for path in sorted(EXTENSION.iterdir()) if path.suffix in (".py", ".toml")}
    client = {f"{CLIENT.name}/{path.name}": path for path in sorted(CLIENT.iterdir()) if path.is_file()}
    return own | client


def write_unpacked(folder: Path) -> Path:
    """Write the extension to `folder/manipnet_live` over an earlier one; returns that path."""
    target = folder / EXTENSION.name
    for name, source in files().items():
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, target / name)
    return target


def write_zip(folder: Path) -> Path:
    """Write `folder/manipnet_live-VERSION.zip`, with the manifest at the root as Blender expects; returns its path."""
    manifest = tomllib.loads((EXTENSION / "blender_manifest.toml").read_text(encoding="utf-8"))
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / f"{manifest['id']}-{manifest['version']}.zip"
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, source in files().items():
            archive.write(source, name)
    return target


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--unpacked", metavar="FOLDER", type=Path, help="write a folder for development, not a zip")
    unpacked = parser.parse_args().unpacked
    print(write_unpacked(unpacked) if unpacked else write_zip(Path("dist")))


if __name__ == "__main__":
    main()
