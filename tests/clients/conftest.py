"""The harnesses of the clients in other languages."""

import functools

import pytest
from languages import build


@pytest.fixture(scope="session")
def harness(tmp_path_factory):
    """By name, the command of a language's client; each is built once."""
    return functools.cache(lambda name: build(name, tmp_path_factory.mktemp(name)))
