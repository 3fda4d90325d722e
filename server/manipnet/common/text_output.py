"""Lets standard output and standard error accept any text, whatever their encoding."""

import io
import os
import sys
from typing import TextIO


def accept_any_text() -> None:
    """Let both streams write what their encoding lacks as backslash escapes. Call this first in every program.

    A pipe or a file has the encoding of the system, which on Windows knows neither arrows nor Japanese names. Standard
    streams that are closed lead nowhere from now on: otherwise a socket would get their descriptors, and with these
    whatever a library writes to its standard error.
    """
    _occupy_descriptors()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # None in a program without a console
            stream.reconfigure(errors="backslashreplace")


def _occupy_descriptors() -> None:
    """Let the descriptors 0, 1 and 2 lead nowhere, as far as they are closed."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    while nowhere <= 2:
        nowhere = os.open(os.devnull, os.O_RDWR)
    os.close(nowhere)


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
