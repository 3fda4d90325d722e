"""Keeps the profile of an avatar's hand in the server, which forgets it when it is restarted or nobody listens."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from .control import ControlClient, RequestError

LOOK_EVERY_S = 0.5
SILENT_AFTER_S = 2.0
"""The server is asked again when no hands of the avatar have arrived for this long."""
ASK_EVERY_S = 3.0


class HandUpload:
    """Uploads a hand profile at once, and again whenever no hands arrive for it, on a thread of its own.

    `age_s` returns how long ago the newest hands of the avatar arrived, as in
    `HandUpload(control, profile, lambda: client.stats().age_s)`. It is a context manager; otherwise call `close`.
    """

    def __init__(
        self, control: ControlClient, profile: dict[str, Any], age_s: Callable[[], float], actor: str | None = None
    ) -> None:
        self._control, self._profile, self._age_s, self._actor = control, profile, age_s, actor
        self._stopping = threading.Event()
        self.uploads = 0
        """How often the server has taken the profile."""
        self.problem = ""
        """Why the server does not have the profile, in its own words if it refuses it; empty if it has it."""
        self._thread = threading.Thread(target=self._run, name="manipnet-upload", daemon=True)
        self._thread.start()

    def __enter__(self) -> HandUpload:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the thread; a request that waits for its answer delays this by at most the client's `timeout_s`."""
        self._stopping.set()
        self._thread.join()

    def _run(self) -> None:
        asked_s = float("-inf")
        while not self._stopping.is_set():
            now_s = time.monotonic()
            if self._age_s() > SILENT_AFTER_S and now_s - asked_s > ASK_EVERY_S:
                asked_s = now_s
                self._upload()
            self._stopping.wait(LOOK_EVERY_S)

    def _upload(self) -> None:
        try:
            self._control.upload_hand(self._profile, self._actor)
        except RequestError as refusal:
            self.problem = f"The server refuses the hand profile: {refusal}"
        except (OSError, ValueError) as error:  # nobody answers, or not with JSON
            self.problem = f"The hand profile cannot be uploaded: {error}"
        else:
            self.problem = ""
            self.uploads += 1
