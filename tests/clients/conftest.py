"""Builds the harnesses of the clients in other languages."""

import functools

import pytest
from languages import build


@pytest.fixture(scope="session")
def harness(tmp_path_factory):
    """Returns the command of a client's harness by name and builds each harness once."""
    return functools.cache(lambda name: build(name, tmp_path_factory.mktemp(name)))
