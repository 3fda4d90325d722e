"""The console on which the verbs print for people."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from rich.console import Console
from rich.progress import Progress, ProgressColumn, SpinnerColumn, Task, TextColumn
from rich.text import Text

UNLIMITED: Final = 10_000
"""Width, in columns, of output that does not go to a terminal."""
WARNING: Final = "bold red"
"""The style of a line that says what is missing."""


def open_console(stderr: bool = True) -> Console:
    """A console on standard error or standard output that prints text unchanged.

    It never breaks a line, so that paths stay whole in terminals, log files and pipes; square brackets have no meaning.
    """
    stream = sys.stderr if stderr else sys.stdout
    return Console(
        stderr=stderr, soft_wrap=True, markup=False, highlight=False, width=None if stream.isatty() else UNLIMITED
    )


class _SecondsLeft(ProgressColumn):
    """The seconds until a task ends."""

    def render(self, task: Task) -> Text:
        return Text(f"{max((task.total or 0.0) - (task.elapsed or 0.0), 0.0):.0f} s left")


@contextmanager
def countdown(what: str, seconds: float) -> Iterator[None]:
    """Say on standard error what goes on for some seconds: a line that counts down, or plain text if it is piped."""
    console = open_console()
    if not console.is_terminal:
        console.print(f"{what} for {seconds:g} s …")
        yield
        return
    with Progress(
        SpinnerColumn(), TextColumn("{task.description}"), _SecondsLeft(), console=console, transient=True
    ) as bar:
        bar.add_task(what, total=seconds)
        yield
