"""What a first start says while it compiles."""

import pytest

from manipnet.runtime.start_progress import TEXT, StartProgress


@pytest.mark.parametrize("is_terminal", [True, False])
def test_it_is_said_once_in_place_on_a_terminal_and_else_in_the_log(is_terminal: bool) -> None:
    shown: list[str] = []
    logged: list[str] = []
    progress = StartProgress(shown.append, logged.append, is_terminal)
    progress.begin()
    progress.begin()
    progress.end()
    assert (shown, logged) == (([TEXT], []) if is_terminal else ([], [TEXT]))
