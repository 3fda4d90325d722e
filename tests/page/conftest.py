"""What the tests of the page share."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from studio import Studio, studio_in


@pytest.fixture(scope="module")
def studio(tiny_bundle: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Studio]:
    with studio_in(tmp_path_factory.mktemp("studio"), tiny_bundle) as studio:
        yield studio
