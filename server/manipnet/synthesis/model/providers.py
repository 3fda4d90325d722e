"""The default model, and what a network may run on."""

from typing import Literal

DEFAULT_MODEL = "manipnet-small"


Provider = Literal["auto", "cpu", "cuda"]


PROVIDERS: tuple[Provider, ...] = ("auto", "cpu", "cuda")
"""What a network runs on; `auto` is an NVIDIA GPU where the extra `gpu` is installed and works, else the processor."""
