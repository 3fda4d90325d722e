"""`manipnet VERB`: one command for everything. The libraries of a verb load only when it is called."""

import importlib
import sys
from collections.abc import Sequence

from manipnet import __version__
from manipnet.common.text_output import accept_any_text, silence
from manipnet.synthesis.model.shipped import version_text
from manipnet_tools.commands.arguments import parsed, parser_for
from manipnet_tools.commands.verbs import VERBS, Verb, options_class

EXAMPLES = """examples:
  manipnet serve --demo
  manipnet serve --mesh Box=mug.obj --look-ahead 0.1
  manipnet replay takes/mug1 --loop
  manipnet record --out take.mcap
  manipnet synthesize takes/mug1 --mesh mug1=meshes/mug1.obj --out fingers.npz
  manipnet batch takes --mesh mug1=meshes/mug1.obj --out fingers
  manipnet export fingers.npz --format gltf --out fingers.glb
  manipnet evaluate --data DATASET --protocol seen
  manipnet train --data DATASET --out models/mine
  manipnet doctor --rig stage.toml"""

EXTRAS = {"torch": "train", "onnx": "train", "matplotlib": "train", "ray": "cluster", "mujoco": "judge"}
"""Libraries that a plain installation lacks, and the extra that installs each."""
OWN_EXTRAS = {"generate": "generate"}
"""Verbs whose libraries an extra of their own installs, apart from those for training."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a verb; returns the exit status: 0 for success, 1 for an error, 2 for a mistyped command."""
    accept_any_text()
    try:
        return _main(list(sys.argv[1:] if argv is None else argv))
    except BrokenPipeError:  # whoever read the output, such as `head`, has read enough
        silence(sys.stdout)
        return 0


def _main(arguments: list[str]) -> int:
    if not arguments or arguments[0] in ("-h", "--help"):
        print(help_text())
        return 0 if arguments else 2
    if arguments[0] == "--version":
        print(version_text("manipnet", __version__))
        return 0
    name, *rest = arguments
    if name not in VERBS:
        print(f"manipnet: there is no verb {name!r}; the verbs are {', '.join(VERBS)}", file=sys.stderr)
        return 2
    return _guarded(name, rest)


def help_text() -> str:
    """The text that `manipnet --help` prints."""
    width = max(map(len, VERBS))
    verbs = "\n".join(f"  {name:{width}}  {verb.summary}" for name, verb in VERBS.items())
    return (
        "usage: manipnet VERB [options]      (manipnet VERB --help prints the options of a verb)\n\n"
        f"Synthesises fingers from tracked wrists and props.\n\nverbs:\n{verbs}\n\n{EXAMPLES}"
    )


def _guarded(name: str, rest: list[str]) -> int:
    """Run a verb; an error that the user can correct is printed as one line instead of a traceback."""
    try:
        return _run(name, VERBS[name], rest)
    except KeyboardInterrupt:
        return 130
    except ModuleNotFoundError as error:
        if error.name not in EXTRAS and name not in OWN_EXTRAS:
            raise
        trains = EXTRAS.get(error.name or "") == "train"
        extra = OWN_EXTRAS[name] if name in OWN_EXTRAS and not trains else EXTRAS[error.name or ""]
        remedy = f"{error.name} is not installed: python -m pip install 'manipnet-live[{extra}]'"
        print(f"manipnet {name}: {remedy}", file=sys.stderr)
    except BrokenPipeError:
        raise
    except (ValueError, OSError) as error:
        if isinstance(error, ValueError) and not type(error).__module__.startswith("manipnet"):
            raise  # a bug of ours, for which the traceback is useful
        print(f"manipnet {name}: {error}", file=sys.stderr)
    return 1


def _run(name: str, verb: Verb, rest: list[str]) -> int:
    if verb.options is None:
        return importlib.import_module(verb.module).main(rest) or 0
    kind = options_class(verb.options)
    options = parsed(kind, parser_for(kind, f"manipnet {name}", verb.examples), rest)
    options.check()
    importlib.import_module(verb.module).run(options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
