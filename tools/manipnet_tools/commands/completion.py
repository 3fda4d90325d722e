"""`manipnet completion`: prints the script with which a shell completes verbs and options."""

import argparse
import importlib
import sys
from collections.abc import Sequence
from typing import Final

from manipnet.common.command_line import Parser
from manipnet_tools.commands.arguments import parser_for
from manipnet_tools.commands.verbs import VERBS, options_class

BASH: Final = """\
_manipnet() {
    local IFS=$'\\n'
    COMPREPLY=($(manipnet completion words -- "${COMP_WORDS[@]:1:COMP_CWORD}" 2>/dev/null))
}
_manipnet_serve() {
    local IFS=$'\\n'
    COMPREPLY=($(manipnet completion words -- serve "${COMP_WORDS[@]:1:COMP_CWORD}" 2>/dev/null))
}
complete -o default -o bashdefault -F _manipnet manipnet
complete -o default -o bashdefault -F _manipnet_serve manipnet-serve
"""
ZSH: Final = """\
_manipnet() {
    local -a found
    found=(${(f)"$(manipnet completion words -- "${(@)words[2,CURRENT]}" 2>/dev/null)"})
    if (( $#found )); then compadd -a found; else _files; fi
}
compdef _manipnet manipnet
"""
FISH: Final = """\
complete -c manipnet -a '(manipnet completion words -- (commandline -opc)[2..-1] (commandline -ct) 2>/dev/null)'
"""
SCRIPTS: Final = {"bash": BASH, "zsh": ZSH, "fish": FISH}
EXAMPLES: Final = (
    'bash                   then, in ~/.bashrc:  eval "$(manipnet completion bash)"',
    'zsh                    then, in ~/.zshrc:   eval "$(manipnet completion zsh)"',
    "fish                   then, in config.fish:  manipnet completion fish | source",
)


def build_parser() -> Parser:
    """The options of `manipnet completion`."""
    parser = Parser(
        "manipnet completion", "Print a script for your shell, which completes verbs and options.", EXAMPLES
    )
    parser.add_argument("shell", choices=tuple(SCRIPTS), help="your shell")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Print the script of a shell, or, for the scripts, what may follow some words. Returns the exit status."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if arguments[:2] == ["words", "--"]:
        print("\n".join(candidates(arguments[2:])))
        return 0
    print(SCRIPTS[build_parser().parse_args(arguments).shell], end="")
    return 0


def candidates(words: Sequence[str]) -> list[str]:
    """What the last of the words, which is not complete yet, may become. Empty where the shell completes files."""
    *before, last = words or [""]
    if not before:
        return _beginning_with(last, [*VERBS, "--help", "--version"])
    parser = _parser(before[0])
    if parser is None:
        return []
    verbs = _subparsers(parser)
    inner = next((word for word in before[1:] if word in verbs), None)
    if inner is not None:
        parser = _parser("serve") if before[:2] == ["rig", "show"] else verbs[inner]
    option = parser._option_string_actions.get(before[-1]) if parser is not None else None
    if option is not None and (choices := _choices(option)):
        return _beginning_with(last, choices)
    if parser is None or (option is not None and option.nargs != 0):
        return []
    names = list(verbs) if inner is None else []
    return _beginning_with(last, [*names, *(parser._option_string_actions if last.startswith("-") else ())])


def _parser(verb: str) -> argparse.ArgumentParser | None:
    """The parser of a verb, or None for an unknown one."""
    if verb not in VERBS:
        return None
    found = VERBS[verb]
    if found.options is None:
        return importlib.import_module(found.module).build_parser()
    return parser_for(options_class(found.options), f"manipnet {verb}")


def _subparsers(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    found = [each for each in parser._actions if isinstance(each, argparse._SubParsersAction)]
    return dict(found[0].choices) if found else {}


def _choices(option: argparse.Action) -> list[str]:
    """The values of an option, if there are only a few."""
    if option.choices:
        return list(option.choices)
    shown = str(option.metavar)
    return shown[1:-1].split(",") if shown.startswith("{") else []


def _beginning_with(text: str, names: Sequence[str]) -> list[str]:
    return [name for name in names if name.startswith(text)]
