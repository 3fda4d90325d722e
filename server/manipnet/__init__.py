"""ManipNet Live synthesises finger motion live from tracked wrists and objects.

This is the public API. Its names load on first use, so that `import manipnet` alone takes no time.
"""

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from manipnet.config.settings import ServerConfig
    from manipnet.server import Server
    from manipnet.synthesis.model.bundle import load_bundle
    from manipnet.synthesis.objects.shape import load_shape
    from manipnet.synthesis.synthesizer import HandScene, Synthesizer

# ONNX Runtime would write an identity of this device to the user's folder and queue events for its maker. The variable
# must be set before its import, and holds in all processes that this one starts.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")

__all__ = ["HandScene", "Server", "ServerConfig", "Synthesizer", "__version__", "load_bundle", "load_shape"]

__version__ = "0.1.0"
"""The one place of the version; the distribution reads it here, and a test compares the clients' with it."""

_MODULES = {
    "HandScene": "manipnet.synthesis.synthesizer",
    "Server": "manipnet.server",
    "ServerConfig": "manipnet.config.settings",
    "Synthesizer": "manipnet.synthesis.synthesizer",
    "load_bundle": "manipnet.synthesis.model.bundle",
    "load_shape": "manipnet.synthesis.objects.shape",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_MODULES])
