"""Lets standard output and standard error accept any text, whatever their encoding."""

import io
import os
import sys
from typing import TextIO


def accept_any_text() -> None:
    """Let both streams write what their encoding lacks as backslash escapes. Call this first in every program.

    A pipe or a file has the encoding of the system, which on Windows knows neither arrows nor Japanese names.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # None in a program without a console
            stream.reconfigure(errors="backslashreplace")


def silence(stream: TextIO) -> None:
    """Let a stream whose reader is gone write to nowhere, so that the end of the program does not fail at it."""
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        try:
            os.dup2(nowhere, stream.fileno())
        finally:
            os.close(nowhere)
    except (OSError, ValueError):
        pass  # it has no descriptor, or is closed already
