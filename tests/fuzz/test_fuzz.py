"""A few hundred cases of every fuzz target in every test run; `fuzz_run.py` does 200,000."""

import pytest
from fuzz_run import fuzz
from fuzz_targets import TARGETS


@pytest.mark.parametrize("name", TARGETS)
def test_target_stands_damage(name):
    tally = fuzz(name, 300)
    assert tally.cases >= 300
    assert tally.refused


@pytest.mark.parametrize("name", TARGETS)
def test_good_inputs_are_read(name):
    for data in TARGETS[name].good:
        TARGETS[name].read(TARGETS[name].place(data))
