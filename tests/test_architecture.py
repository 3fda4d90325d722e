"""Imports point one way: from the command line down to geometry, and never from the runtime to the tools."""

import ast
from pathlib import Path

import pytest

from manipnet.jit import COMPILED

ROOT = Path(__file__).parents[1]
SERVER, TOOLS = ROOT / "server" / "manipnet", ROOT / "tools" / "manipnet_tools"

LAYERS = (
    ("wire", "telemetry", "geometry", "jit"),
    ("net", "synthesis"),
    ("inputs", "config", "tracking"),
    ("outputs", "actors"),
    ("runtime",),
    ("control",),
    ("recording",),
    ("page", "demo"),
    ("server",),
    ("cli",),
)
"""From the ground up. A module may import its own layer and those below it; a name stands for a folder's modules."""

HEIGHT = {name: height for height, layer in enumerate(LAYERS) for name in layer}
HEAVY = {"tyro", "viser", "rich", "torch", "mcap", "matplotlib", "onnx", "ray"}
"""What the tick path must not drag in."""


def modules(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*.py") if path.name != "__init__.py")


def imported(path: Path) -> set[str]:
    """Absolute names a file imports, anywhere in it."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            assert node.module is not None
            names |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def part(path: Path) -> str:
    return path.relative_to(SERVER).parts[0].removesuffix(".py")


@pytest.mark.parametrize("path", modules(SERVER), ids=lambda path: str(path.relative_to(SERVER)))
def test_imports_point_down(path: Path) -> None:
    own = part(path)
    assert own in HEIGHT, f"{own} has no place in LAYERS: give it one"
    for name in imported(path):
        assert not name.startswith("manipnet_tools"), f"{path.name} imports {name}: the runtime must not need the tools"
        used = name.split(".")[1] if name.startswith("manipnet.") else None
        if used in HEIGHT:
            assert HEIGHT[used] <= HEIGHT[own], f"{own} imports {used}, which stands above it"


def test_nothing_imports_in_a_circle() -> None:
    graph = {part(path): set[str]() for path in modules(SERVER)}
    for path in modules(SERVER):
        used = {name.split(".")[1] for name in imported(path) if name.startswith("manipnet.")}
        graph[part(path)] |= (used & graph.keys()) - {part(path)}
    while graph:
        free = {name for name, used in graph.items() if not used & graph.keys()}
        assert free, f"these import each other: {', '.join(sorted(graph))}"
        for name in free:
            del graph[name]


def test_every_layer_has_its_modules() -> None:
    missing = HEIGHT.keys() - {part(path) for path in modules(SERVER)}
    assert missing <= {"page", "recording", "demo"}, f"LAYERS names {missing}, which is gone"


@pytest.mark.parametrize("path", modules(SERVER), ids=lambda path: str(path.relative_to(SERVER)))
def test_the_live_path_stays_light(path: Path) -> None:
    if part(path) not in ("page", "recording", "demo"):
        heavy = {name.split(".")[0] for name in imported(path)} & HEAVY
        assert not heavy, f"{path.name} imports {heavy}"


@pytest.mark.parametrize("path", modules(SERVER), ids=lambda path: str(path.relative_to(SERVER)))
def test_compiled_code_is_where_the_cache_looks_for_changes(path: Path) -> None:
    parts = {name.removesuffix(".py") for name in COMPILED}
    if imported(path) & {"manipnet.jit.kernel", "manipnet.jit.inner"}:
        used = {name.split(".")[1] for name in imported(path) if name.startswith("manipnet.")}
        assert used - {"jit"} | {part(path)} <= parts


@pytest.mark.parametrize("path", [*modules(SERVER), *modules(TOOLS)], ids=lambda path: path.name)
def test_nothing_that_runs_code_is_read_from_a_wire_or_file(path: Path) -> None:
    roots = {name.split(".")[0] for name in imported(path)}
    assert not roots & {"pickle", "shelve", "marshal", "dill", "cloudpickle", "joblib"}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and ast.unparse(node.func) in ("np.load", "numpy.load", "torch.load"):
            safe = {keyword.arg: ast.unparse(keyword.value) for keyword in node.keywords}
            assert safe.get("allow_pickle") == "False" or safe.get("weights_only") == "True", ast.unparse(node)


@pytest.mark.parametrize("path", modules(SERVER), ids=lambda path: path.name)
def test_private_pipes_carry_bytes(path: Path) -> None:
    if "multiprocessing" in imported(path):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "recv":
                assert node.args, f"{ast.unparse(node)} unpickles; recv_bytes does not"


def test_tools_are_a_package_of_their_own() -> None:
    for path in modules(TOOLS):
        for name in imported(path):
            assert name.split(".")[0] != "tests", f"{path.name} imports {name}"
