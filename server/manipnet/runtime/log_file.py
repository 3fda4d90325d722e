"""The log file of a server, in a folder of the user: one for each start, of limited size; old ones are deleted."""

import logging
import os
import time
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import Final

from platformdirs import user_log_path

MAX_BYTES: Final = 1 << 20
BACKUPS: Final = 2
"""Older parts of the same log that are kept."""
MAX_FILES: Final = 10
"""Logs of earlier starts that are kept."""


class LogFile(RotatingFileHandler):
    """Writes log records to a file. A disk that is full costs records, but nothing else."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 - the name that logging calls
        """Leave out a record that cannot be written."""


def log_folder() -> Path:
    """The folder of the log files."""
    return user_log_path("manipnet", appauthor=False)


def open_log_file() -> LogFile | None:
    """A new log file, or None if none can be created."""
    folder = log_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path in sorted(folder.glob("server *.log"))[: -MAX_FILES + 1]:
            for part in folder.glob(f"{path.name}*"):
                part.unlink(missing_ok=True)
        path = folder / f"server {time.strftime('%Y-%m-%d %H.%M.%S')} {os.getpid()}.log"
        return LogFile(path, maxBytes=MAX_BYTES, backupCount=BACKUPS, encoding="utf-8", errors="backslashreplace")
    except OSError:
        return None
