"""What every test may ask for."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

# the first example pays for compiling; the same examples every run
settings.register_profile("manipnet", deadline=None, derandomize=True)
settings.load_profile("manipnet")


@pytest.fixture(scope="session")
def manipnet_data() -> Path:
    """The ManipNet dataset, which is not part of the project."""
    folder = os.environ.get("MANIPNET_DATA")
    if not folder:
        pytest.skip("MANIPNET_DATA is not set: it names the dataset folder (BVH/ and meshes/)")
    return Path(folder)
