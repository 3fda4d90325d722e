"""Write rigs of avatars with the hand profiles that `manipnet hand import` makes of them, for the clients' tests.

Run `python tests/vectors/make_hand_profiles.py` after a change of the import; a test fails while they differ.
`hand_profiles.json` maps the name of a rig to `bones` ([name, parent, x, y, z] in metres) and `profile`. The rigs have
no skin, so the profiles have no radii.
"""

import json
import sys
import tempfile
from pathlib import Path

FOLDER = Path(__file__).parent
sys.path.insert(0, str(FOLDER.parent / "support"))

from avatar_rigs import KINDS, Rig, avatar_rig  # noqa: E402
from rig_writer import write_glb  # noqa: E402

from manipnet.synthesis.hand.profile import profile_to_json  # noqa: E402
from manipnet.synthesis.model.shipped import shipped_hand  # noqa: E402
from manipnet_tools.hands.importing import import_profile  # noqa: E402


def profile_of(rig: Rig, name: str) -> dict:
    """The profile of a rig, as decoded JSON."""
    with tempfile.TemporaryDirectory() as folder:
        nodes = list(zip(rig.names, rig.parents, rig.positions, strict=True))
        file = write_glb(Path(folder) / "avatar.glb", nodes)
        profile = import_profile(file, name, shipped_hand(), lambda _: None)
    content = json.loads(profile_to_json(profile))
    for side in ("left", "right"):
        del content[side]["radii"]
    return content


def vectors() -> str:
    """The content of the file."""
    rigs = {}
    for kind in KINDS:
        rig = avatar_rig(kind)
        bones = [
            [name, parent, *(round(float(x), 7) for x in place)]
            for name, parent, place in zip(rig.names, rig.parents, rig.positions, strict=True)
        ]
        rigs[kind] = {"bones": bones, "profile": profile_of(rig, kind)}
    text = json.dumps(rigs, separators=(",", ":"))
    return text.replace('},"', '},\n"').replace("],[", "],\n[") + "\n"


if __name__ == "__main__":
    (FOLDER / "hand_profiles.json").write_text(vectors(), encoding="utf-8")
