"""Writes Open Sound Control messages and bundles, by python-osc.

It is not used to read what comes from outside: see `inputs/osc/packet.py`.
"""

from collections.abc import Iterable

from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message import OscMessage
from pythonosc.osc_message_builder import OscMessageBuilder


def osc_message(address: str, types: str, *values: int | float | str) -> OscMessage:
    """A message with one argument for each letter of `types`: i (int32), f (float32), d (float64), s (text)."""
    builder = OscMessageBuilder(address)
    for kind, value in zip(types, values, strict=True):
        builder.add_arg(value, kind)
    return builder.build()


def osc_bundle(messages: Iterable[OscMessage]) -> bytes:
    """A bundle of the messages, tagged "immediately"."""
    builder = OscBundleBuilder(IMMEDIATELY)
    for message in messages:
        builder.add_content(message)
    return builder.build().dgram
