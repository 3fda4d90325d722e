"""`manipnet hand`: makes, draws and checks the hand profile of an avatar."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from manipnet.common.command_line import Parser
from manipnet.config.files import require_file, require_hand
from manipnet.synthesis.hand.shipped_files import NAMES
from manipnet.synthesis.model.providers import DEFAULT_MODEL
from manipnet.synthesis.model.shipped import find_bundle
from manipnet_tools.commands.checks import require_meshes, require_new, require_take

_HAND = "a profile, or a shipped hand: " + ", ".join(NAMES)
EXAMPLES = (
    "import avatar.vrm --out hand.json            make a profile, and hand.png that shows it",
    "import avatar.glb --map bones.json --out hand.json",
    "show adult --out adult.png                   draw a hand that is shipped",
    "check hand.json takes/mug1 --mesh mug1=mug1.obj",
)
FORCE = "replace what exists already"
MAP = 'A map is a JSON file {"left": {"wrist": "Hand_L", "index_proximal": "Finger1_L", …}, "right": {…}}.'


def main(argv: Sequence[str] | None = None) -> int:
    """Do what the arguments say. Returns the exit status; raises `ValueError`s of the package for a wrong file."""
    options = build_parser().parse_args(argv)
    options.do(options)
    return 0


def build_parser() -> Parser:
    """The options of `manipnet hand`."""
    parser = Parser(
        "manipnet hand",
        f"Make, draw and check the profile of an avatar's hand, on which the server then solves contact.\n{MAP}",
        EXAMPLES,
    )
    verbs = parser.add_subparsers(dest="verb", required=True, parser_class=Parser, prog="manipnet hand")
    take_in = verbs.add_parser("import", help="make a profile from the rig of an avatar")
    take_in.add_argument("avatar", type=Path, metavar="AVATAR", help="the avatar: .glb, .vrm or .bvh")
    take_in.add_argument("--map", type=Path, metavar="FILE", help="JSON file that says which bone is which joint")
    take_in.add_argument("--name", help="name of the profile (default: that of the avatar's file)")
    take_in.add_argument("--out", type=Path, required=True, metavar="HAND.json", help="the file to write")
    take_in.add_argument("--no-picture", action="store_true", help="write the profile alone, which is much faster")
    take_in.add_argument("--force", action="store_true", help=FORCE)
    take_in.set_defaults(do=_import)
    show = verbs.add_parser("show", help="draw a profile")
    show.add_argument("hand", type=Path, metavar="HAND", help=_HAND)
    show.add_argument("--out", type=Path, required=True, metavar="FILE.png", help="the picture to write")
    show.add_argument("--force", action="store_true", help=FORCE)
    show.set_defaults(do=_show)
    check = verbs.add_parser("check", help="measure on a take how much contact survives on the hand")
    check.add_argument("hand", type=Path, metavar="HAND", help=_HAND)
    check.add_argument("take", type=Path, metavar="TAKE", help="the take, as for `manipnet synthesize`")
    check.add_argument("--mesh", action="append", default=[], metavar="NAME=FILE", help="an object and its mesh")
    check.add_argument("--model", default=DEFAULT_MODEL, metavar="NAME", help="the model (default: %(default)s)")
    check.add_argument("--drop", action="store_true", help="also let a simulator drop the object (extra judge)")
    check.set_defaults(do=_check)
    return parser


def _import(options: argparse.Namespace) -> None:
    require_file(options.avatar)
    require_file(options.map)
    picture = options.out.with_suffix(".png")
    for file in (options.out,) if options.no_picture else (options.out, picture):
        require_new(file, options.force)
    from manipnet.synthesis.hand.profile import profile_to_json
    from manipnet.synthesis.model.shipped import shipped_hand
    from manipnet_tools.hands.importing import import_profile, profile_name

    name = options.name or profile_name(options.avatar)
    profile = import_profile(options.avatar, name, shipped_hand(), print, options.map)
    options.out.write_text(profile_to_json(profile), encoding="utf-8")
    print(f"wrote {options.out}")
    if not options.no_picture:
        _draw(options.out, picture)


def _show(options: argparse.Namespace) -> None:
    require_hand(options.hand)
    require_new(options.out, options.force)
    _draw(options.hand, options.out)


def _draw(hand: Path, out: Path) -> None:
    from manipnet.synthesis.hand.profile import read_profile
    from manipnet.synthesis.model.bundle import load_bundle
    from manipnet_tools.hands.drawing import draw_profile
    from manipnet_tools.rendering import save_png

    bundle = load_bundle()
    save_png(draw_profile(read_profile(hand), bundle.hand, bundle.rest_angles), out)
    print(f"wrote {out}: left and right hand straight and bent, and below them the model's hand; bars are hinges")


def _check(options: argparse.Namespace) -> None:
    require_hand(options.hand)
    require_take(options.take)
    require_meshes(options.mesh)
    find_bundle(options.model)
    from manipnet.synthesis.hand.profile import read_profile
    from manipnet_tools.hands.check import check_profile

    for line in check_profile(read_profile(options.hand), options.take, options.mesh, options.model, options.drop):
        print(line)


if __name__ == "__main__":
    sys.exit(main())
