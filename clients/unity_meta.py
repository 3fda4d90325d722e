"""Write the `.meta` file that Unity requires beside every asset of the package.

Run `python clients/unity_meta.py` after adding or moving a file. The GUID in it is made from the asset's path, so it
never changes and references to the asset stay valid.
"""

import hashlib
from pathlib import Path

PACKAGE = Path(__file__).parent / "unity" / "com.manipnet.client"
IMPORTERS = {".cs": "MonoImporter", ".asmdef": "AssemblyDefinitionImporter", ".md": "TextScriptImporter"}
IMPORTERS |= {"package.json": "PackageManifestImporter", ".png": "TextureImporter", ".svg": "DefaultImporter"}
IMPORTERS |= {".jslib": "PluginImporter"}
WEBGL_ONLY = """  serializedVersion: 2
  platformData:
  - first:
      Any:
    second:
      enabled: 0
      settings: {}
  - first:
      WebGL: WebGL
    second:
      enabled: 1
      settings: {}
"""
"""The settings of a browser script: no other platform compiles it."""


def files(package: Path) -> dict[Path, str]:
    """Every meta file with its text. Unity ignores a folder whose name ends in ~, but not the assets in it."""
    assets = [path for path in sorted(package.rglob("*")) if path.suffix != ".meta" and not path.name.endswith("~")]
    return {path.with_name(path.name + ".meta"): _meta(path, package) for path in assets}


def _meta(asset: Path, package: Path) -> str:
    guid = hashlib.md5(f"com.manipnet.client/{asset.relative_to(package).as_posix()}".encode()).hexdigest()
    folder = "folderAsset: yes\n" if asset.is_dir() else ""
    importer = "DefaultImporter" if asset.is_dir() else IMPORTERS.get(asset.name) or IMPORTERS[asset.suffix]
    settings = WEBGL_ONLY if asset.suffix == ".jslib" else ""
    return (
        f"fileFormatVersion: 2\nguid: {guid}\n{folder}{importer}:\n  externalObjects: {{}}\n{settings}"
        "  userData:\n  assetBundleName:\n  assetBundleVariant:\n"
    )


if __name__ == "__main__":
    for path, text in files(PACKAGE).items():
        path.write_text(text, encoding="utf-8", newline="\n")
