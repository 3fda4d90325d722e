"""Options of the fuzz tests, and one line for each in the summary.

`pytest tests/fuzz --fuzz-seconds 600` gives each test ten minutes.
"""

import pytest

DEFAULT_SEED = 1
RESULTS = pytest.StashKey[list[str]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("fuzzing")
    group.addoption("--fuzz-seconds", type=float, help="how long each fuzz test goes on (default: a few seconds)")
    group.addoption("--fuzz-seed", type=int, default=DEFAULT_SEED, help="seed of the fuzz tests (default: %(default)s)")


@pytest.fixture
def fuzz_seconds(pytestconfig: pytest.Config) -> float | None:
    """How long a fuzz test goes on; None if no option says so."""
    return pytestconfig.getoption("fuzz_seconds", None)


@pytest.fixture
def fuzz_seed(pytestconfig: pytest.Config) -> int:
    """The seed of a fuzz test."""
    return int(pytestconfig.getoption("fuzz_seed", DEFAULT_SEED) or DEFAULT_SEED)


@pytest.fixture
def report_line(pytestconfig: pytest.Config):
    """Adds a line to the summary of a run in which `--fuzz-seconds` was given."""
    return pytestconfig.stash.setdefault(RESULTS, []).append


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    if config.getoption("fuzz_seconds", None) is not None:
        for line in config.stash.get(RESULTS, []):
            terminalreporter.write_line(line)
