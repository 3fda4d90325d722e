"""How each wrist and prop arrives at present, for the metrics: the same figures as in the answer to `status`."""

import math
import time
from collections.abc import Iterator

from manipnet.control.actors_proxy import ActorsProxy
from manipnet.control.request import RequestError
from manipnet.telemetry import Gauge


def body_gauges(proxy: ActorsProxy) -> Iterator[Gauge]:
    """The rate and the age of each body by `actor/part`. While the tick thread does not answer, there are none."""
    now_s = time.monotonic()
    try:
        healths = proxy.ask(lambda: {actor.config.name: dict(actor.health(now_s)) for actor in proxy.actors})
    except RequestError:
        return
    bodies = {f"{actor}/{part}": each for actor, parts in healths.items() for part, each in parts.items()}
    yield "body_rate_hz", "body", {name: health.rate_hz for name, health in bodies.items()}
    arrived = {name: health.age_s for name, health in bodies.items() if math.isfinite(health.age_s)}
    yield "body_age_seconds", "body", arrived
