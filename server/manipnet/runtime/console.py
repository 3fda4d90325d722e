"""Lines for the person at the terminal, from a thread of their own: a stopped terminal must not stop the ticks."""

import contextlib
import errno
import json
import logging
import queue
import re
import sys
import threading
import time
from typing import Any, Final

from manipnet.common.text_output import silence
from manipnet.telemetry import RepeatFilter

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
    """Writes `say` to standard output and log records to standard error; drops lines if nobody reads them."""

    def __init__(self, as_json: bool = False) -> None:
        super().__init__()
        self.setFormatter(JsonFormatter() if as_json else logging.Formatter(LOG_FORMAT))
        self.addFilter(RepeatFilter())
        self._is_quiet = False
        """Whether standard output has no reader any more."""
        self._lines: queue.Queue[tuple[str, bool] | None] = queue.Queue(WAITING_LINES)
        self._thread = threading.Thread(target=self._write, name="console", daemon=True)
        self._thread.start()

    def say(self, line: str) -> None:
        """Let the thread write a line to standard output."""
        self._put((line, False))

    def emit(self, record: logging.LogRecord) -> None:
        """Let the thread write a log record to standard error."""
        self._put((self.format(record), True))

    def close(self) -> None:
        """Write the lines that wait, unless nobody reads them, and stop."""
        if self._thread.is_alive():
            self._put(None)
            self._thread.join(timeout=1.0)
        super().close()

    def _put(self, line: tuple[str, bool] | None) -> None:
        with contextlib.suppress(queue.Full):
            self._lines.put_nowait(line)

    def _write(self) -> None:
        while (line := self._lines.get()) is not None:
            text, is_log = line
            try:
                self._print(text, is_log)
            except Exception as error:  # a line may be lost, but not the lines after it
                if is_log or not _is_gone(error):
                    continue
                self._is_quiet = True
                silence(sys.stdout)
                with contextlib.suppress(Exception):
                    self._print(f"standard output cannot be written any more ({error}); the log goes on", True)

    def _print(self, text: str, is_log: bool) -> None:
        stream = sys.stderr if is_log else sys.stdout
        if stream is None or (self._is_quiet and not is_log):
            return
        text = _CONTROLS.sub(lambda found: f"\\x{ord(found[0]):02x}", text)
        try:
            print(text, file=stream, flush=True)
        except UnicodeEncodeError:
            encoding = stream.encoding or "ascii"
            print(text.encode(encoding, "backslashreplace").decode(encoding), file=stream, flush=True)


def _is_gone(error: Exception) -> bool:
    """Whether an error says that nobody can read an output any more, unlike that of a full disk."""
    return isinstance(error, BrokenPipeError | ValueError) or getattr(error, "errno", None) in (errno.EBADF, errno.EIO)
