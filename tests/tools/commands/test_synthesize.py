"""The file `manipnet synthesize` writes."""

from dataclasses import replace

import numpy as np
import pytest

from manipnet.common.options import ConfigError
from manipnet_tools.commands.options import SynthesizeOptions
from manipnet_tools.commands.synthesize import read_shapes, run
from manipnet_tools.takes.take import TakeError, read_take


def test_the_file_holds_both_hands_in_the_world_at_sixty_hertz(still_model, manipnet_data, tmp_path):
    options = SynthesizeOptions(
        take=manipnet_data / "BVH" / "mug1",
        mesh=(f"mug1={manipnet_data / 'meshes' / 'mug1.obj'}",),
        out=tmp_path / "hands.npz",
        model=str(still_model),
    )
    run(options)
    with np.load(options.out) as file:
        arrays = dict(file)
    time, take = arrays["time"], read_take(options.take)
    np.testing.assert_allclose(np.diff(time), 1 / 60, atol=1e-6)
    assert time[0] <= 1.0
    assert time[-1] >= take.time_s[-1] - 1.0
    for side in ("left", "right"):
        assert arrays[f"{side}_positions"].shape == arrays[f"{side}_raw_positions"].shape == (len(time), 22, 3)
        assert arrays[f"{side}_rotations"].shape == (len(time), 17, 4)
        assert arrays[f"{side}_distances"].shape == (len(time), 22)
        wrist = take.bodies[f"{side}_wrist"].poses[np.round(time * take.rate_hz).astype(int)]
        np.testing.assert_allclose(arrays[f"{side}_positions"][:, 0], wrist[:, :3], atol=1e-6)
        aligned = np.abs((arrays[f"{side}_rotations"][:, 0] * wrist[:, 3:]).sum(axis=1))
        np.testing.assert_allclose(aligned, 1.0, atol=1e-6)
    with pytest.raises(ConfigError, match=r"--look-ahead is 0\.7 s; allowed are 0 to 0\.5"):
        replace(options, look_ahead=0.7, force=True).check()
    with pytest.raises(TakeError, match=r"--mesh spoon=x\.obj: no object is called 'spoon'; the objects are mug1"):
        read_shapes(("spoon=x.obj",), take, options.take)
