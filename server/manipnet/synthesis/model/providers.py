"""What is known about models before one is loaded: the default, the longest look-ahead, what a network may run on."""

from typing import Final, Literal

DEFAULT_MODEL = "manipnet-small"

MAX_LOOK_AHEAD_S: Final = 0.5
"""The future that a model's window covers."""

Provider = Literal["auto", "cpu", "cuda"]


PROVIDERS: tuple[Provider, ...] = ("auto", "cpu", "cuda")
"""What a network runs on; `auto` is an NVIDIA GPU where the extra `gpu` is installed and works, else the processor."""
