"""`manipnet VERB`: one command for everything. Each verb's libraries load only when it is called."""

import importlib
import sys
from collections.abc import Sequence
from dataclasses import dataclass

from manipnet import __version__


@dataclass(frozen=True)
class Verb:
    """A verb and who does it: `module.main(argv)`, or `module.run(options)` where a class of options is named."""

    summary: str
    module: str
    options: str | None = None
    examples: tuple[str, ...] = ()
    """Options and what they do, as `--help` shows them; none for a module that shows its own."""


VERBS = {
    "serve": Verb("fingers live from tracked wrists and props (same as manipnet-serve)", "manipnet.cli"),
    "replay": Verb(
        "send a take to a server, as the tracker would",
        "manipnet_tools.commands.replay",
        "ReplayOptions",
        (
            "takes/mug1 --to tcp://127.0.0.1:5556             to a server on this machine",
            "take.mcap --to tcp://127.0.0.1:5556 --loop       a recording, over and over",
            "motive.csv --to osc://127.0.0.1 --speed 0.5      Motive's export, over OSC, slowly",
        ),
    ),
    "record": Verb(
        "write what is tracked and synthesised to a recording",
        "manipnet_tools.commands.record",
        "RecordOptions",
        (
            "--out take.mcap                          beside a running server, until Ctrl-C",
            "--out take.mcap --rig stage.toml         and keep its rig and meshes in the file",
            "--out take.mcap --bodies-port 5556       without a server: what the tracker sends",
        ),
    ),
    "recover": Verb(
        "mend a recording that was cut off",
        "manipnet_tools.commands.recover",
        "RecoverOptions",
        ("take.mcap --out mended.mcap",),
    ),
    "synthesize": Verb(
        "fingers for a take, offline",
        "manipnet_tools.commands.synthesize",
        "SynthesizeOptions",
        (
            "takes/mug1 --mesh mug1=meshes/mug1.obj --out fingers.npz",
            "take.mcap --mesh Box=hammer.obj --out hammer.npz       the same take with another object",
            "motive.csv --rig stage.toml --out fingers.npz          Motive's export, with the calibration of its rig",
        ),
    ),
    "batch": Verb(
        "fingers for a folder of takes, on all processors or a cluster",
        "manipnet_tools.batch.command",
        "BatchOptions",
        (
            "takes --mesh mug1=mug1.obj --mesh cup1=cup1.obj --out fingers",
            "takes --mesh mug1=mug1.obj --out fingers --ray 192.168.1.7:6379      on a Ray cluster",
        ),
    ),
    "export": Verb(
        "hands and objects for other programs: BVH, glTF, CSV",
        "manipnet_tools.export.command",
        "ExportOptions",
        (
            "take.mcap --format gltf --out take.glb                     what a recording shows, to see anywhere",
            "fingers.npz --format bvh --out fingers                     the ManipNet dataset's layout, in a folder",
            "fingers.npz --format bvh --out fingers --right-handed      for Blender and Maya",
            "takes/mug1 --format csv --out mug1.csv                     captured fingers as a table",
        ),
    ),
    "evaluate": Verb(
        "judge models on captured takes",
        "manipnet_tools.evaluation.command",
        "EvaluateOptions",
        (
            "--data DATASET                                    the shipped model on the last 20 % of every take",
            "--data DATASET --model models/mine --json figures.json",
        ),
    ),
    "train": Verb(
        "train a model on captured takes",
        "manipnet_tools.training.train",
        "TrainOptions",
        ("--data DATASET --out models/mine",),
    ),
    "ablate": Verb(
        "train and judge the rows of the paper's Table 1",
        "manipnet_tools.evaluation.ablate",
        "AblateOptions",
        ("--data DATASET --out ablation                both protocols, 49 short trainings",),
    ),
    "quantise": Verb(
        "write a bundle again with 8-bit weights",
        "manipnet_tools.training.quantise",
        "QuantiseOptions",
        ("manipnet-full --out models/manipnet-full-int8",),
    ),
    "bench": Verb(
        "measure how long a tick takes, stage by stage",
        "manipnet_tools.bench",
        None,
        ("--only tick --seconds 20", "--json figures.json"),
    ),
    "doctor": Verb(
        "say why no tracked bodies arrive",
        "manipnet_tools.doctor.command",
        None,
        (
            "                                listen where the server would, for 5 s",
            "--rig stage.toml                and say which of the rig's bodies are missing",
            "--natnet 192.168.1.5            ask Motive there",
        ),
    ),
    "rig": Verb("write a rig file from what is heard, or show a configuration", "manipnet_tools.commands.rig"),
    "calibrate": Verb(
        "find where the wrists sit on their bodies, and the size of the hands",
        "manipnet_tools.commands.calibrate",
        "CalibrateOptions",
        (
            "--hand-length 0.19                       sheet at the world's origin, beside a running server",
            "--at 0.4 0.75 0 --yaw 90                 sheet on a table elsewhere",
            "--reference Box --fingertips             sheet under the tracked box; measure the hand length",
        ),
    ),
    "keys": Verb("make and list the keys that let clients in over the network", "manipnet_tools.commands.keys"),
}

EXAMPLES = """examples:
  manipnet serve --demo
  manipnet serve --mesh Box=mug.obj --look-ahead 0.1
  manipnet replay takes/mug1 --to tcp://127.0.0.1:5556 --loop
  manipnet record --out take.mcap
  manipnet synthesize takes/mug1 --mesh mug1=meshes/mug1.obj --out fingers.npz
  manipnet batch takes --mesh mug1=meshes/mug1.obj --out fingers
  manipnet export fingers.npz --format gltf --out fingers.glb
  manipnet evaluate --data DATASET --protocol seen
  manipnet train --data DATASET --out models/mine
  manipnet doctor --rig stage.toml"""

EXTRAS = {"torch": "train", "onnx": "train", "matplotlib": "train", "ray": "cluster"}
"""Libraries that do not come with a plain installation, and what to install to have them."""


def main(argv: Sequence[str] | None = None) -> int:
    """Do what the verb says; the exit status: 0, 1 for what cannot be done, 2 for a mistyped command."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if not arguments or arguments[0] in ("-h", "--help"):
        print(help_text())
        return 0 if arguments else 2
    if arguments[0] == "--version":
        print(f"manipnet {__version__}")
        return 0
    name, *rest = arguments
    if name not in VERBS:
        print(f"manipnet: no verb {name!r}; verbs are {', '.join(VERBS)}", file=sys.stderr)
        return 2
    return _guarded(name, rest)


def help_text() -> str:
    """What `manipnet --help` prints."""
    width = max(map(len, VERBS))
    verbs = "\n".join(f"  {name:{width}}  {verb.summary}" for name, verb in VERBS.items())
    return (
        "usage: manipnet VERB [options]      (manipnet VERB --help: the options of a verb)\n\n"
        f"Fingers for tracked wrists and props.\n\nverbs:\n{verbs}\n\n{EXAMPLES}"
    )


def _guarded(name: str, rest: list[str]) -> int:
    """Run a verb; what a user can mend becomes one line instead of a traceback."""
    try:
        return _run(name, VERBS[name], rest)
    except KeyboardInterrupt:
        return 130
    except ModuleNotFoundError as error:
        if error.name not in EXTRAS:
            raise
        remedy = f"{error.name} is not installed: python -m pip install 'manipnet-live[{EXTRAS[error.name]}]'"
        print(f"manipnet {name}: {remedy}", file=sys.stderr)
    except (ValueError, OSError) as error:
        if isinstance(error, ValueError) and not type(error).__module__.startswith("manipnet"):
            raise  # a mistake of ours: the traceback is what is needed
        print(f"manipnet {name}: {error}", file=sys.stderr)
    return 1


def _run(name: str, verb: Verb, rest: list[str]) -> int:
    module = importlib.import_module(verb.module)
    try:
        if verb.options is None:
            return module.main(rest) or 0
        import tyro

        config = (tyro.conf.FlagCreatePairsOff,)
        options = tyro.cli(getattr(module, verb.options), prog=f"manipnet {name}", args=rest, config=config)
    except SystemExit as end:
        if not end.code and verb.examples:
            print("\nexamples:", *(f"  manipnet {name} {example}" for example in verb.examples), sep="\n")
        raise
    module.run(options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
