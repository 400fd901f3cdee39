"""Metrics sent to an OpenTelemetry collector: OTLP over HTTP, once."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from typing import Any

import requests
from opentelemetry.exporter.otlp.proto.http.metric_exporter import OTLPMetricExporter
from opentelemetry.metrics import CallbackOptions, Observation
from opentelemetry.sdk.metrics import MeterProvider
from opentelemetry.sdk.metrics.export import InMemoryMetricReader, MetricExportResult
from opentelemetry.sdk.resources import Resource
from prometheus_client import CollectorRegistry
from prometheus_client.metrics_core import Metric

from facade_core.core.errors import InputError

# Where collectors take metrics, below their address.
METRICS_PATH = "/v1/metrics"


def send_metrics(registry: CollectorRegistry, url: str) -> int:
    """Send gauges, by their names and labels, to the collector at `url`, as http://127.0.0.1:4318. Returns how many values.

    Headers, certificates and how long to wait are the environment's (OTEL_EXPORTER_OTLP_*), as are more attributes of the
    resource (OTEL_RESOURCE_ATTRIBUTES). Raises InputError where it does not take them.
    """
    if not url.startswith(("http://", "https://")):
        raise InputError(f"--otlp {url}: is no address of a collector; write it such as http://127.0.0.1:4318")
    families = list(registry.collect())
    reader = InMemoryMetricReader()
    resource = Resource.create({"service.name": "streetloom", "service.version": version("streetloom")})
    provider = MeterProvider([reader], resource, shutdown_on_exit=False)
    meter = provider.get_meter("streetloom")
    for family in families:
        meter.create_observable_gauge(family.name, [_observe(family)], description=family.documentation)
    session = _RecordingSession()
    with _silence_exporter_log():
        exporter = OTLPMetricExporter(url if url.endswith(METRICS_PATH) else url.rstrip("/") + METRICS_PATH, session=session)
        data = reader.get_metrics_data()
        taken = data is not None and exporter.export(data) is MetricExportResult.SUCCESS
        exporter.shutdown()
    provider.shutdown()
    if not taken:
        why = " ".join(session.outcome.split())[:300]
        raise InputError(
            f"--otlp {url}: takes no metrics ({why}); check that a collector listens there for OTLP over HTTP"
        )
    return sum(len(family.samples) for family in families)


def _observe(family: Metric) -> Callable[[CallbackOptions], Iterable[Observation]]:
    return lambda options: [Observation(sample.value, sample.labels) for sample in family.samples]


class _RecordingSession(requests.Session):
    """What a collector answers, or why it does not, which the exporter tells nobody but its log."""

    outcome = "nothing was sent"

    def request(self, *arguments: Any, **options: Any) -> requests.Response:
        try:
            answer = super().request(*arguments, **options)
        except requests.RequestException as error:
            self.outcome = str(error)
            raise
        self.outcome = f"{answer.status_code} {answer.reason}"
        return answer


@contextmanager
def _silence_exporter_log() -> Iterator[None]:
    logger = logging.getLogger("opentelemetry")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)
