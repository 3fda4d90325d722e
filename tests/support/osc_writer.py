"""OSC datagrams for tests, written by python-osc."""

import struct

from pythonosc.osc_message_builder import OscMessageBuilder


def osc(address, *arguments) -> bytes:
    """A message. An argument `(type, value)` has that type, any other one the type that python-osc chooses."""
    builder = OscMessageBuilder(address)
    for argument in arguments:
        builder.add_arg(*(argument[::-1] if isinstance(argument, tuple) else (argument,)))
    return builder.build().dgram


def bundle(*elements: bytes, tag: int = 1) -> bytes:
    """A bundle of messages or bundles with an NTP time tag, 1 is "immediately"."""
    return b"#bundle\0" + struct.pack(">Q", tag) + b"".join(struct.pack(">i", len(e)) + e for e in elements)
