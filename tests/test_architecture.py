"""Imports point one way: from the command line down to geometry, and never from the server to the tools."""

import ast
import functools
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from manipnet.jit import COMPILED

ROOT = Path(__file__).parents[1]
SERVER, TOOLS = ROOT / "server" / "manipnet", ROOT / "tools" / "manipnet_tools"

LAYERS = (
    ("wire", "common", "telemetry", "geometry", "jit"),
    ("net", "synthesis"),
    ("inputs", "outputs", "tracking"),
    ("config",),
    ("actors",),
    ("runtime",),
    ("control",),
    ("recording",),
    ("page", "demo"),
    ("server",),
    ("cli",),
)
"""The server's packages and root modules, lowest first. Each may import its own layer and those below it."""
HEIGHT = {name: height for height, layer in enumerate(LAYERS) for name in layer}

MAX_ROOT_MODULES = {SERVER: 6, TOOLS: 4}
"""Modules that may lie beside the packages, `__init__` included; all others belong in a package."""
HEAVY = {"viser", "rich", "torch", "mcap", "matplotlib", "onnx", "ray"}
"""Libraries that the tick path must not load."""
MAY_BE_HEAVY = {"page", "recording", "demo"}
VERSION = "manipnet.__version__"
UNSAFE = {"pickle", "shelve", "marshal", "dill", "cloudpickle", "joblib"}
"""Libraries whose readers run code that the data names."""


@functools.cache
def modules(package: Path) -> tuple[Path, ...]:
    return tuple(sorted(package.rglob("*.py")))


@functools.cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    """Everything in a file, functions and TYPE_CHECKING blocks included."""
    return tuple(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


@functools.cache
def imported(path: Path) -> frozenset[str]:
    """Absolute names that a file imports anywhere: modules, and what it takes from them."""
    names: set[str] = set()
    for node in nodes(path):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            assert node.module is not None
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return frozenset(names)


def top_libraries(path: Path) -> set[str]:
    return {name.split(".")[0] for name in imported(path)}


def server_parts(path: Path) -> set[str]:
    """Packages and root modules of the server that a file imports."""
    return {name.split(".")[1] for name in imported(path) if name.startswith("manipnet.")} & HEIGHT.keys()


def part(path: Path) -> str:
    """The package or root module of the server to which a file belongs."""
    return path.relative_to(SERVER).parts[0].removesuffix(".py")


def calls(path: Path) -> Iterator[ast.Call]:
    return (node for node in nodes(path) if isinstance(node, ast.Call))


def server_modules() -> list[Path]:
    """All files of the server but the root's `__init__`, which is above every layer."""
    return [path for path in modules(SERVER) if path != SERVER / "__init__.py"]


def dotted(path: Path) -> str:
    """The name under which a file is imported."""
    root = SERVER.parent if path.is_relative_to(SERVER) else TOOLS.parent
    return ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")


def file_graph() -> dict[str, set[str]]:
    """Which files of server and tools each file imports.

    The version is left out: it lies in the public API's file, which imports from everywhere, but only on first use.
    """
    known = {dotted(path) for path in [*modules(SERVER), *modules(TOOLS)]}
    graph: dict[str, set[str]] = {}
    for path in [*modules(SERVER), *modules(TOOLS)]:
        names = {name if name in known else name.rpartition(".")[0] for name in imported(path) - {VERSION}}
        graph[dotted(path)] = (names & known) - {dotted(path)}
    return graph


def package_graph() -> dict[str, set[str]]:
    """The same of packages: the first two words of each file's name."""
    graph: dict[str, set[str]] = {}
    for name, used in file_graph().items():
        graph.setdefault(package(name), set()).update(map(package, used))
    return {name: used - {name} for name, used in graph.items()}


def package(name: str) -> str:
    return ".".join(name.split(".")[:2])


@pytest.mark.parametrize("graph", [file_graph, package_graph], ids=["files", "packages"])
def test_nothing_imports_in_a_circle(graph) -> None:
    try:
        TopologicalSorter(graph()).prepare()
    except CycleError as circle:
        pytest.fail(" imports ".join(reversed(circle.args[1])))


def test_imports_point_down() -> None:
    for path in server_modules():
        assert part(path) in HEIGHT, f"{part(path)} has no place in LAYERS: give it one"
        assert "manipnet_tools" not in top_libraries(path), f"{path} imports the tools, which the server must not need"
        above = {used for used in server_parts(path) if HEIGHT[used] > HEIGHT[part(path)]}
        assert not above, f"{path} imports {above}, which is in a layer above it"


def test_every_layer_has_its_modules() -> None:
    assert HEIGHT.keys() == {part(path) for path in server_modules()}


@pytest.mark.parametrize("folder", [SERVER, TOOLS], ids=lambda folder: folder.name)
def test_few_modules_lie_at_the_root(folder: Path) -> None:
    names = sorted(path.name for path in folder.glob("*.py"))
    assert len(names) <= MAX_ROOT_MODULES[folder], f"{names}: move one into a package"


def test_the_live_path_stays_light() -> None:
    for path in server_modules():
        heavy = top_libraries(path) & HEAVY if part(path) not in MAY_BE_HEAVY else set()
        assert not heavy, f"{path} imports {heavy}"


def test_compiled_code_is_where_the_cache_looks_for_changes() -> None:
    parts = {name.removesuffix(".py") for name in COMPILED}
    for path in server_modules():
        if imported(path) & {"manipnet.jit.kernel", "manipnet.jit.inner"}:
            own = set() if path.relative_to(SERVER).as_posix() in COMPILED else {part(path)}
            assert server_parts(path) - {"jit"} | own <= parts, f"{path}: COMPILED in jit.py misses a part"


def test_nothing_that_runs_code_is_read_from_a_wire_or_file() -> None:
    for path in [*modules(SERVER), *modules(TOOLS)]:
        assert not top_libraries(path) & UNSAFE, path
        for call in calls(path):
            if ast.unparse(call.func) in ("np.load", "numpy.load", "torch.load"):
                given = {keyword.arg: ast.unparse(keyword.value) for keyword in call.keywords}
                safe = given.get("allow_pickle") == "False" or given.get("weights_only") == "True"
                assert safe, f"{path}: {ast.unparse(call)}"


def test_private_pipes_carry_bytes() -> None:
    for path in modules(SERVER):
        if "multiprocessing" in top_libraries(path):
            for call in calls(path):
                unpickles = isinstance(call.func, ast.Attribute) and call.func.attr == "recv" and not call.args
                assert not unpickles, f"{path}: {ast.unparse(call)} unpickles; recv_bytes does not"
