"""Hands, bodies and events as streams of Lab Streaming Layer, for recordings beside EEG and eye trackers."""

from dataclasses import dataclass

from manipnet.common.options import ConfigError, Switch, option
from manipnet.outputs.declaration import Emission, HandsOutput, Output


@dataclass(frozen=True)
class LslOptions:
    """Whether streams of Lab Streaming Layer are offered."""

    lsl: bool = option(
        False, Switch(), "offer streams of Lab Streaming Layer to every machine of the network; needs the extra lsl"
    )


def _open(options: LslOptions, emission: Emission) -> HandsOutput:
    try:
        from manipnet.outputs.lsl.sender import LslSender
    except (ImportError, OSError, RuntimeError) as error:  # the package is missing, or its library
        raise ConfigError(f"pylsl cannot be loaded ({error}); run: pip install 'manipnet-live[lsl]'") from None

    return LslSender()


LSL = Output("lsl", "Lab Streaming Layer: hands, bodies and events, for LabRecorder", LslOptions, _open)
