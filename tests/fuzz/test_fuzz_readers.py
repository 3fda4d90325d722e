"""Damaged inputs for every reader: a few hundred in every run, and more with `--fuzz-seconds`."""

import logging
import math

import pytest
from fuzz_cases import fuzz, good_s
from fuzz_imports import IMPORT_TARGETS
from fuzz_readers import TARGETS

CASES = 300
FEW = 60
"""Cases for the imports, which fit a whole hand to what they read."""


@pytest.mark.parametrize("name", TARGETS)
def test_a_reader_raises_only_its_own_error(name, fuzz_seconds, fuzz_seed, report_line):
    logging.disable()  # the warnings about damage, of which there are thousands
    try:
        cases = FEW if name in IMPORT_TARGETS else CASES
        tally = fuzz(name, cases if fuzz_seconds is None else math.inf, fuzz_seed, fuzz_seconds or math.inf)
    finally:
        logging.disable(logging.NOTSET)
    report_line(f"{name}: {tally}, the good input {1e3 * good_s(name):.3f} ms, seed {fuzz_seed}")
    assert tally.cases >= cases
    assert tally.refused


@pytest.mark.parametrize("name", TARGETS)
def test_good_inputs_are_read(name):
    for data in TARGETS[name].good:
        TARGETS[name].read(TARGETS[name].place(data))
