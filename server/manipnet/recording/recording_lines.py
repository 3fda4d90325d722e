"""What the terminal shows of recordings: the one in progress, its begin and its end, and what was kept."""

from manipnet.recording.recorder import Recorder
from manipnet.runtime.status import Second


class RecordingLines:
    """Describes the recordings of a server, once per second."""

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder
        self._name: str | None = None

    def next(self) -> Second:
        """The recording in progress with its length, and whether one has begun or ended since the last call."""
        recording = self._recorder.current()
        before, self._name = self._name, None if recording is None else recording.path.name
        changes = []
        if before is not None and before != self._name:
            changes.append(f"the recording {before} has ended")
        if recording is None or self._name is None:
            return Second("", tuple(changes))
        if before != self._name:
            changes.append(f"recording {recording.path}")
        minutes, seconds = divmod(int(recording.seconds), 60)
        return Second(f"REC {recording.path.stem} {minutes}:{seconds:02d}", tuple(changes))

    def kept(self) -> str:
        """Which recordings of this session are kept, and where."""
        names = self._recorder.finished
        if not names:
            return "nothing was recorded"
        takes = "1 recording is" if len(names) == 1 else f"{len(names)} recordings are"
        newest = ", ".join(names[-4:])
        return f"{takes} kept in {self._recorder.folder}: {'…, ' if len(names) > 4 else ''}{newest}"
