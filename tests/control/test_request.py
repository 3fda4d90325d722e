"""The values of requests: what makes no sense is refused with its true reason."""

import math

import pytest

from manipnet.control.request import RequestError, body_key, number


@pytest.mark.parametrize("value", [10**400, -(10**400), math.inf, math.nan, True, "1", None, 2, -1])
def test_numbers_out_of_range_are_refused(value) -> None:
    with pytest.raises(RequestError, match=r"^x is .*0\.0 … 1\.0$"):
        number({"x": value}, "x", 0.0, 1.0)


@pytest.mark.parametrize("value", [0, 1, 0.5])
def test_numbers_in_range_are_taken(value) -> None:
    assert number({"x": value}, "x", 0.0, 1.0) == float(value)


@pytest.mark.parametrize("body", ["", "x" * 129, "a\x1b[31m", "a\n", "a\0", None, True, 1.5, [], 10**400, 1 << 31])
def test_bodies_that_cannot_be_streamed_are_refused(body) -> None:
    with pytest.raises(RequestError, match=r"^body is "):
        body_key({"body": body})


@pytest.mark.parametrize("body", ["Box", "日本", 0, -5, 7])
def test_bodies_that_can_be_streamed_are_taken(body) -> None:
    assert body_key({"body": body}) == body
