"""The console on which the verbs print for people."""

import sys

from rich.console import Console

UNLIMITED = 10_000
"""Width, in columns, of output that does not go to a terminal."""


def open_console(stderr: bool = True) -> Console:
    """A console on standard error or standard output that prints text unchanged.

    It never breaks a line, so that paths stay whole in terminals, log files and pipes; square brackets have no meaning.
    """
    stream = sys.stderr if stderr else sys.stdout
    return Console(stderr=stderr, soft_wrap=True, markup=False, width=None if stream.isatty() else UNLIMITED)
