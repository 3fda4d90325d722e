"""Stand-ins for the headers of Unreal Engine: every one includes our stubs, and a small header tool makes the rest."""

import re
from pathlib import Path

from checkout import CLIENTS, ROOT
from languages import CPP, WARNINGS

MODULE = CLIENTS / "unreal" / "ManipNetLiveLink" / "Source" / "ManipNetLiveLink"
STUBS = ROOT / "tests" / "clients" / "cpp" / "stubs"
INCLUDE = re.compile(r'#include "([^"]+)"')
CLASS = re.compile(
    r"UCLASS\(.*?\)\s*class\s+(?:\w+_API\s+)?(\w+)\s*:\s*public\s+(\w+)\s*\{\s*GENERATED_BODY\(\)", re.DOTALL
)


def write_headers(folder: Path) -> list[str]:
    """Write a header for every one that the plugin includes and lacks; returns the compiler's options."""
    folders = (MODULE / "Private", MODULE / "Public")
    own = {path.relative_to(f).as_posix() for f in folders for path in f.rglob("*.h")}
    for source in [*MODULE.glob("P*/*.h"), *MODULE.glob("P*/*.cpp")]:
        for name in INCLUDE.findall(source.read_text(encoding="utf-8")):
            if name not in own:
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                text = _generated(source) if name.endswith(".generated.h") else ""
                (folder / name).write_text(f'#include "Unreal.h"\n{text}', encoding="utf-8")
    paths = (STUBS, folder, *folders, CPP)
    return ["-std=c++17", *WARNINGS[:2], "-Werror", *(f"-I{path}" for path in paths)]


def _generated(header: Path) -> str:
    """What the engine's header tool adds to the classes of a header, by the lines of their GENERATED_BODY."""
    text = header.read_text(encoding="utf-8")
    identity = f"FID_{header.stem}_"
    lines = ["#undef CURRENT_FILE_ID", f"#define CURRENT_FILE_ID {identity}"]
    for found in CLASS.finditer(text):
        line = text.count("\n", 0, found.end()) + 1
        name, base = found.groups()
        static = f'static UClass* StaticClass() {{ static UClass type{{"{name}"}}; return &type; }}'
        lines += [f"#define {identity}{line}_GENERATED_BODY public: using Super = {base}; {static} private:"]
    return "\n".join(lines) + "\n"
