"""Lets tests call functions that otherwise only kernels call."""

from numba import njit


@njit
def call(function, *arguments):
    """The result of a compiled `function`."""
    return function(*arguments)
