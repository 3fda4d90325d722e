"""The verbs of `manipnet`, by name: what each does, and the module that does it."""

import importlib
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Verb:
    """A verb and the module that does it: `module.run(options)` if there is a class of options, else
    `module.main(argv)`. Options are checked before the module, and so its libraries, are imported."""

    summary: str
    module: str
    options: str | None = None
    """Full name of the class of options."""
    examples: tuple[str, ...] = ()
    """Options and what they do, printed below `--help`. A module with `main` may print its own instead."""


_OPTIONS = "manipnet_tools.commands.options"
_COMPLETION = "manipnet_tools.commands.completion"
VERBS = {
    "serve": Verb("synthesise fingers live from tracked wrists and props (same as manipnet-serve)", "manipnet.cli"),
    "replay": Verb(
        "send a take to a server, as a tracker would",
        "manipnet_tools.commands.replay",
        f"{_OPTIONS}.ReplayOptions",
        (
            "takes/mug1                                       to the server on this machine",
            "take.mcap --server 192.168.1.7 --loop            repeat a recording until stopped",
            "motive.csv --to osc://127.0.0.1 --speed 0.5      an export of Motive, over OSC, at half speed",
        ),
    ),
    "record": Verb(
        "record tracked bodies and synthesised hands",
        "manipnet_tools.commands.record",
        f"{_OPTIONS}.RecordOptions",
        (
            "--out take.mcap                          beside a running server, until Ctrl-C",
            "--out take.mcap --server 192.168.1.7     beside a server on another machine",
            "--out take.mcap --rig stage.toml         keep the rig and its meshes in the recording",
            "--out take.mcap --bodies-port 5556       without a server: the bodies that a tracker sends",
        ),
    ),
    "recover": Verb(
        "repair a recording that was cut off",
        "manipnet_tools.commands.recover",
        f"{_OPTIONS}.RecoverOptions",
        ("take.mcap --out repaired.mcap",),
    ),
    "synthesize": Verb(
        "synthesise the fingers of a take offline",
        "manipnet_tools.commands.synthesize",
        f"{_OPTIONS}.SynthesizeOptions",
        (
            "takes/mug1 --mesh mug1=meshes/mug1.obj --out fingers.npz",
            "take.mcap --mesh Box=hammer --out hammer.npz           the same take with an object of the library",
            "motive.csv --rig stage.toml --out fingers.npz          an export of Motive with a calibrated rig",
        ),
    ),
    "batch": Verb(
        "synthesise the fingers of all takes in a folder, on all processors or a cluster",
        "manipnet_tools.batch.command",
        f"{_OPTIONS}.BatchOptions",
        (
            "takes --mesh mug1=mug1.obj --mesh cup1=cup1.obj --out fingers",
            "takes --mesh mug1=mug1.obj --out fingers --ray 192.168.1.7:6379      on a Ray cluster",
        ),
    ),
    "export": Verb(
        "write hands and objects for other programs: BVH, glTF, CSV",
        "manipnet_tools.export.command",
        f"{_OPTIONS}.ExportOptions",
        (
            "take.mcap --format gltf --out take.glb                     the hands and objects of a recording",
            "fingers.npz --format bvh --out fingers                     a folder in the ManipNet dataset's layout",
            "fingers.npz --format bvh --out fingers --right-handed      for Blender and Maya",
            "takes/mug1 --format csv --out mug1.csv                     captured fingers as a table",
        ),
    ),
    "hand": Verb("make, draw and check the profile of an avatar's hand", "manipnet_tools.hands.command"),
    "evaluate": Verb(
        "compare models with captured takes",
        "manipnet_tools.evaluation.command",
        "manipnet_tools.evaluation.options.EvaluateOptions",
        (
            "--data DATASET                                    the shipped model on the last 20 % of every take",
            "--data DATASET --model models/mine --json figures.json",
            "--data DATASET --only drop --takes mug1           only the drop test, on one take",
            "--data DATASET --only drop --protocol unseen --fingers mug1=mug1.npz      what synthesize wrote",
        ),
    ),
    "import": Verb(
        "make takes for training out of public sets and glove takes",
        "manipnet_tools.importing.command",
        "manipnet_tools.importing.options.ImportOptions",
        (
            'taco TACO --out DATA --only "(stir, *"            some of the TACO set (CC BY 4.0)',
            "dexterhand DEXTERHAND --out DATA                 the DexterHand set, with the hands as BVH",
            "bvh gloves --mesh Mug=mug.obj --out DATA         folders of a studio's own glove takes",
        ),
    ),
    "generate": Verb(
        "make takes for training out of nothing: free hands, objects and motions",
        "manipnet_tools.generate.command",
        "manipnet_tools.generate.options.GenerateOptions",
        (
            "--out generated --hours 4                        on all processors; run it again to continue",
            "--out generated --hours 2 --train models/mine    and train a model, by the recipe of manipnet-open",
            "--out generated --hours 40 --ray 192.168.1.7:6379      on a Ray cluster",
        ),
    ),
    "train": Verb(
        "train a model on captured or generated takes",
        "manipnet_tools.training.train",
        "manipnet_tools.training.options.TrainOptions",
        (
            "--data DATASET --out models/mine                 one folder of takes",
            "--data DATASET generated=0.5 --out models/mixed  two folders, one sample in three from the second",
            "--data DATASET --start models/open --out tuned   go on from a bundle",
        ),
    ),
    "ablate": Verb(
        "train and evaluate the rows of the paper's Table 1",
        "manipnet_tools.evaluation.ablate",
        "manipnet_tools.evaluation.options.AblateOptions",
        ("--data DATASET --out ablation                both protocols, 49 short trainings",),
    ),
    "quantise": Verb(
        "convert a bundle to 8-bit weights",
        "manipnet_tools.training.quantise",
        "manipnet_tools.training.options.QuantiseOptions",
        ("manipnet-full --out models/manipnet-full-int8",),
    ),
    "bench": Verb(
        "say whether this computer is fast enough, or measure each stage of a tick",
        "manipnet_tools.bench.command",
        "manipnet_tools.bench.options.BenchOptions",
        (
            "                                is this computer fast enough?",
            "--full --json figures.json      all stages, beside a reference (extra train)",
            "--only tick --seconds 20",
        ),
    ),
    "doctor": Verb(
        "find out why no tracked bodies arrive",
        "manipnet_tools.doctor.command",
    ),
    "rig": Verb(
        "write a rig file from the bodies that arrive, or print a configuration", "manipnet_tools.commands.rig"
    ),
    "calibrate": Verb(
        "find where the wrists sit on their bodies, and the size of the hands",
        "manipnet_tools.commands.calibrate",
        f"{_OPTIONS}.CalibrateOptions",
        (
            "--hand-length 0.19                       beside a running server, the sheet at the world's origin",
            "--at 0.4 0.75 0 --yaw 90                 the sheet on a table elsewhere",
            "--reference Box --fingertips             the sheet under the tracked box; measure the hand length",
        ),
    ),
    "keys": Verb("make and list the keys of clients that connect over the network", "manipnet_tools.commands.keys"),
    "completion": Verb("print the script with which your shell completes verbs and options", _COMPLETION),
}


def options_class(name: str) -> Any:
    """The class of options with that full name."""
    module, _, kind = name.rpartition(".")
    return getattr(importlib.import_module(module), kind)
