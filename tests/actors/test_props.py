"""The choice of a prop is that of the nearest one, although not every distance is computed."""

from pathlib import Path

import numpy as np
import pytest

from manipnet.actors.props import HYSTERESIS_M, PALM_M, Prop, choose_prop
from manipnet.geometry import Array, invert, quat_normalize, transform
from manipnet.synthesis.objects.library import load_library_mesh
from manipnet.synthesis.objects.shape import build_shape
from manipnet.tracking.tick import BodyAtTick
from manipnet.wire import Side


@pytest.fixture(scope="module")
def props(tmp_path_factory: pytest.TempPathFactory) -> list[Prop]:
    cache: Path = tmp_path_factory.mktemp("cache")
    cube, bowl = (build_shape(load_library_mesh(name), cache) for name in ("cube", "bowl"))
    return [Prop("a", "cube", cube), Prop("b", "bowl", bowl), Prop("c", "cube", cube, 2.5)]


def nearest(side: Side, wrist: Array, props: list[Prop], poses: dict[str, Array], current: str | None) -> Prop:
    """The same choice by brute force."""
    palm = transform(wrist, np.array(PALM_M[side]))
    distances = [
        prop.shape.signed_distance(transform(invert(poses[prop.name]), palm)[None] / prop.scale)[0][0] * prop.scale
        - HYSTERESIS_M * (prop.name == current)
        for prop in props
    ]
    return props[int(np.argmin(distances))]


@pytest.mark.parametrize("current", [None, "a", "c"])
def test_a_hand_belongs_to_the_nearest_prop(props: list[Prop], current: str | None) -> None:
    rng = np.random.default_rng(5)
    for _ in range(60):
        wrist, *poses = np.concatenate([rng.normal(0.0, 0.15, (4, 3)), quat_normalize(rng.normal(size=(4, 4)))], axis=1)
        named = dict(zip("abc", poses, strict=True))
        bodies = {name: BodyAtTick(np.tile(pose, (21, 1)), pose, 0.0) for name, pose in named.items()}
        for side in ("left", "right"):
            chosen = choose_prop(side, wrist, props, bodies, current)
            assert chosen is nearest(side, wrist, props, named, current)
