"""Prometheus metrics over HTTP, from a thread of their own."""

from collections.abc import Iterator
from typing import Final

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_LATEST
from prometheus_client.registry import Collector

from manipnet.net.errors import ListenError
from manipnet.net.small_http import SmallHttpServer
from manipnet.telemetry import STAGES, Telemetry

QUANTILES: Final = (50.0, 99.0, 99.9, 100.0)


class MetricsPage:
    """Serves the telemetry of a session at `http://host:port/metrics`."""

    def __init__(self, host: str, port: int, telemetry: Telemetry) -> None:
        """Raises `ListenError`."""
        registry = CollectorRegistry()
        registry.register(_TelemetryCollector(telemetry))
        try:
            self._server = SmallHttpServer(host, port, CONTENT_TYPE_LATEST, lambda: generate_latest(registry))
        except OSError as error:
            raise ListenError(
                f"--metrics-port: cannot listen on {host}:{port}: {error.strerror}; --metrics-port 0 takes a free one"
            ) from None
        self.address = f"http://{host}:{self._server.port}/metrics"

    def close(self) -> None:
        """Stop serving."""
        self._server.close()


class _TelemetryCollector(Collector):
    def __init__(self, telemetry: Telemetry) -> None:
        self._telemetry = telemetry

    def collect(self) -> Iterator[Metric]:
        """Every counter, with zeros for labels that were not counted yet, the stage durations and the gauges."""
        counts = self._telemetry.counts()
        for name, (label, values) in self._telemetry.labels().items():
            family = CounterMetricFamily(f"manipnet_{name}", name.replace("_", " "), labels=[label])
            for value in values:
                family.add_metric([value], counts.get(name, {}).get(value, 0))
            yield family
        yield self._stages()
        for name, label, levels in self._telemetry.gauges():
            gauge = GaugeMetricFamily(f"manipnet_{name}", name.replace("_", " "), labels=[label])
            for value, level in levels.items():
                gauge.add_metric([value], level)
            yield gauge

    def _stages(self) -> Metric:
        name, timings = "manipnet_stage_seconds", self._telemetry.timings
        family = Metric(name, "time spent per tick", "summary")
        for stage in STAGES:
            count, sum_s = timings.totals(stage)
            family.add_sample(f"{name}_count", {"stage": stage}, count)
            family.add_sample(f"{name}_sum", {"stage": stage}, sum_s)
            for quantile, value in zip(QUANTILES, timings.overall(stage, *QUANTILES), strict=True):
                family.add_sample(name, {"stage": stage, "quantile": f"{quantile / 100:g}"}, value)
        return family
