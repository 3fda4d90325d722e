"""A screen of a terminal: what a person sees after all that was written to it."""


class Screen:
    """The lines of a terminal, of which the last may be rewritten. It understands line feeds and carriage returns."""

    def __init__(self) -> None:
        self.lines = [""]
        self._at = 0

    def write(self, text: str) -> None:
        for letter in text:
            if letter == "\n":
                self.lines.append("")
                self._at = 0
            elif letter == "\r":
                self._at = 0
            else:
                line = self.lines[-1].ljust(self._at)
                self.lines[-1] = line[: self._at] + letter + line[self._at + 1 :]
                self._at += 1

    def flush(self) -> None:
        pass
