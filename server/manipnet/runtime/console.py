"""Lines for the person at the terminal, from a thread of their own: a stopped terminal must not stop the ticks."""

import contextlib
import errno
import functools
import json
import logging
import queue
import re
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, Final, TextIO

from manipnet.common.log_limits import RepeatFilter
from manipnet.common.text_output import silence
from manipnet.runtime.terminal import Terminal, ready_table

WAITING_LINES: Final = 200
_CONTROLS: Final = re.compile("[\0-\b\v-\x1f\x7f-\x9f]")
"""Characters that would move the cursor of a terminal, or worse. Line feeds and tabs are not among them."""
LOG_FORMAT: Final = "%(asctime)s %(levelname)s %(name)s: %(message)s"


class JsonFormatter(logging.Formatter):
    """One JSON object per line: `time` (UTC), `level`, `logger`, `message`, and `event`, the message's template."""

    def format(self, record: logging.LogRecord) -> str:
        """The record as JSON text."""
        line: dict[str, Any] = {
            "time": f"{time.strftime('%Y-%m-%dT%H:%M:%S', time.gmtime(record.created))}.{int(record.msecs):03d}Z",
            "level": record.levelname.lower(),
            "logger": record.name,
            "event": getattr(record, "event", record.msg),
            "message": record.getMessage(),
        }
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line, ensure_ascii=False, default=str)


class Console(logging.Handler):
    """Writes `say` to standard output and log records to standard error; drops lines if nobody reads them.

    On a terminal, the addresses are a table, and `show` replaces a status line in place. Both outputs also go to
    `log_file`, if there is one.
    """

    def __init__(self, as_json: bool = False, log_file: logging.FileHandler | None = None) -> None:
        super().__init__()
        self.setFormatter(JsonFormatter() if as_json else logging.Formatter(LOG_FORMAT))
        self.addFilter(RepeatFilter())
        self._file = log_file
        if log_file is not None:
            log_file.setFormatter(logging.Formatter(LOG_FORMAT))
        self._is_quiet = False
        """Whether standard output has no reader any more."""
        self._terminal = Terminal(sys.stdout) if sys.stdout is not None and sys.stdout.isatty() else None
        self._is_one = self._terminal is not None and sys.stderr is not None and sys.stderr.isatty()
        """Whether the log goes to the same terminal."""
        self._lines: queue.Queue[Callable[[], None] | None] = queue.Queue(WAITING_LINES)
        self._thread = threading.Thread(target=self._write, name="console", daemon=True)
        self._thread.start()

    @property
    def is_terminal(self) -> bool:
        """Whether standard output is a terminal."""
        return self._terminal is not None

    def say(self, line: str) -> None:
        """Let the thread write a line to standard output."""
        self._put(lambda: self._say(line))

    def show(self, status: str) -> None:
        """Let the thread replace the status line of a terminal. Nothing is written to a file or a pipe."""
        if self._terminal is not None:
            self._put(lambda: self._show(status))

    def emit(self, record: logging.LogRecord) -> None:
        """Let the thread write a log record to standard error."""
        text = self.format(record)
        self._put(lambda: self._log(text, record))

    def close(self) -> None:
        """Write the lines that wait, unless nobody reads them, and stop."""
        if self._thread.is_alive():
            self.show("")
            self._put(None)
            self._thread.join(timeout=1.0)
        if self._file is not None:
            self._file.close()
        super().close()

    def _put(self, task: Callable[[], None] | None) -> None:
        with contextlib.suppress(queue.Full):
            self._lines.put_nowait(task)

    def _write(self) -> None:
        while (task := self._lines.get()) is not None:
            with contextlib.suppress(Exception):  # a line may be lost, but not the lines after it
                task()

    def _say(self, line: str) -> None:
        if self._file is not None:
            self._file.handle(logging.LogRecord("manipnet", logging.INFO, "", 0, line, None, None))
        if self._is_quiet or sys.stdout is None:
            return
        lines = [line]
        if self._terminal is not None and line.startswith("ready "):
            lines = ready_table(line, None if self._file is None else self._file.baseFilename)
        try:
            for each in lines:
                _print(each, sys.stdout, self._terminal)
        except Exception as error:
            self._gone(error)

    def _show(self, status: str) -> None:
        if self._is_quiet or self._terminal is None:
            return
        try:
            self._terminal.status(_without_controls(status))
        except Exception as error:
            self._gone(error)

    def _log(self, text: str, record: logging.LogRecord) -> None:
        if self._file is not None:
            self._file.handle(record)
        if sys.stderr is not None:
            _print(text, sys.stderr, self._terminal if self._is_one and not self._is_quiet else None)

    def _gone(self, error: Exception) -> None:
        """Stop writing to standard output if nobody can read it."""
        if not _is_gone(error):
            return
        self._is_quiet = True
        silence(sys.stdout)
        if sys.stderr is not None:
            _print(f"standard output cannot be written any more ({error}); the log goes on", sys.stderr, None)


def _print(text: str, stream: TextIO, terminal: Terminal | None) -> None:
    text = _without_controls(text)
    write = functools.partial(print, file=stream, flush=True) if terminal is None else terminal.line
    try:
        write(text)
    except UnicodeEncodeError:
        encoding = stream.encoding or "ascii"
        write(text.encode(encoding, "backslashreplace").decode(encoding))


def _without_controls(text: str) -> str:
    return _CONTROLS.sub(lambda found: f"\\x{ord(found[0]):02x}", text)


def _is_gone(error: Exception) -> bool:
    """Whether an error says that nobody can read an output any more, unlike that of a full disk."""
    return isinstance(error, BrokenPipeError | ValueError) or getattr(error, "errno", None) in (errno.EBADF, errno.EIO)
