"""The parser of every command line: one layout of help texts, and errors that name the option and what is allowed."""

import argparse
import difflib
import re
import sys
from collections.abc import Sequence
from typing import Any, Final, NoReturn

WIDTH: Final = 100
"""The widest line of a help text, in columns."""
_CHOICE: Final = re.compile(r"argument (?P<what>.+?): invalid choice: (?P<value>.+?) \(choose from (?P<allowed>.*)\)")
_OF_OPTION: Final = re.compile(r"argument (?P<what>.+?): (?P<problem>.*)", re.DOTALL)
_MISSING: Final = "the following arguments are required: "
_UNKNOWN: Final = "unrecognized arguments: "


class Parser(argparse.ArgumentParser):
    """An `argparse` parser whose errors are one ordinary sentence on one line. It ends with status 2 after an error."""

    def __init__(self, prog: str, description: str = "", examples: Sequence[str] = (), **how: Any) -> None:
        """`examples` are the lines below the options; each begins after the name of the program."""
        epilog = "\n".join(["examples:", *(f"  {prog} {example}".rstrip() for example in examples)]) if examples else ""
        super().__init__(
            prog, description=description, formatter_class=_Layout, **{"usage": None, "epilog": epilog, **how}
        )

    def error(self, message: str) -> NoReturn:
        """Print what is wrong and end the program with status 2."""
        print(f"{self.prog}: {self._plain(message)} (`{self.prog} --help` lists the options)", file=sys.stderr)
        raise SystemExit(2)

    def _plain(self, message: str) -> str:
        """A message of `argparse` in plain words."""
        if message.startswith(_MISSING):
            missing = message.removeprefix(_MISSING).split(", ")
            return f"{' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing"
        if message.startswith(_UNKNOWN):
            return self._unknown(message.removeprefix(_UNKNOWN))
        if found := _CHOICE.fullmatch(message):
            value, allowed = (found[each].replace("'", "") for each in ("value", "allowed"))
            return f"{value} is not known here; allowed are {allowed}"
        if found := _OF_OPTION.fullmatch(message):
            problem = found["problem"].replace("expected one argument", "needs a value")
            problem = problem.replace("ignored explicit argument", "takes no value, but was given")
            return f"{found['what']} {problem}"
        return message

    def _unknown(self, words: str) -> str:
        word = words.split()[0].partition("=")[0]
        if not word.startswith("-"):
            return f"{words!r} is one argument too many"
        near = difflib.get_close_matches(word, self._option_string_actions, 1)
        return f"there is no option {word}" + (f"; did you mean {near[0]}?" if near else "")


class _Layout(argparse.RawDescriptionHelpFormatter):
    """Wraps help texts at the width of the terminal, and leaves descriptions and examples as they are."""

    def __init__(self, prog: str, **how: Any) -> None:
        super().__init__(prog, max_help_position=26, **how)
        self._width = min(self._width, WIDTH)

    def add_usage(self, usage: Any, actions: Any, groups: Any, prefix: str | None = None) -> None:
        """Print a short usage line: the positional arguments and the options that are required."""
        if usage is None:
            needed = [action for action in actions if action.required and action.option_strings]
            words = [f"{action.option_strings[0]} {self._format_args(action, '')}".rstrip() for action in needed]
            positional = [action.metavar or action.dest for action in actions if not action.option_strings]
            usage = " ".join(["%(prog)s", *map(str, positional), *words, "[options]"])
        super().add_usage(usage, actions, groups, prefix)
