"""Push of metrics to an OpenTelemetry collector: OTLP over HTTP, once."""

from __future__ import annotations

import errno
import logging
import os
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

from catalogs.imagery.http_client import redact_url
from facade_core.core.errors import InputError

# Path of metrics below a collector's address.
METRICS_PATH = "/v1/metrics"


def send_metrics(registry: CollectorRegistry, url: str) -> int:
    """Send gauges with their names and labels to a collector, and return the number of values.

    The environment sets headers, certificates and timeouts (OTEL_EXPORTER_OTLP_*), and more resource attributes
    (OTEL_RESOURCE_ATTRIBUTES).

    Parameters
    ----------
    registry : gauges to send.
    url : address of the collector, such as http://127.0.0.1:4318.

    Raises
    ------
    InputError : the collector does not accept them.
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
        exporter = OTLPMetricExporter(
            url if url.endswith(METRICS_PATH) else url.rstrip("/") + METRICS_PATH, session=session
        )
        data = reader.get_metrics_data()
        accepted = data is not None and exporter.export(data) is MetricExportResult.SUCCESS
        exporter.shutdown()
    provider.shutdown()
    if not accepted:
        raise InputError(
            f"--otlp {redact_url(url)}: takes no metrics ({session.outcome}); check that a collector listens there for "
            "OTLP over HTTP"
        )
    return sum(len(family.samples) for family in families)


def _observe(family: Metric) -> Callable[[CallbackOptions], Iterable[Observation]]:
    return lambda options: [Observation(sample.value, sample.labels) for sample in family.samples]


def describe_request_error(error: requests.RequestException) -> str:
    """Return why a request got no answer, in a few words."""
    if isinstance(error, requests.Timeout):
        return "no answer in time"
    if isinstance(error, requests.exceptions.SSLError):
        return "no connection by TLS, or a certificate that is not trusted"
    if isinstance(error, requests.exceptions.ProxyError):
        return "the proxy of the environment does not answer"
    if isinstance(error, requests.exceptions.InvalidURL | requests.exceptions.InvalidSchema):
        return "it is no address"
    text = str(error)
    known = (
        os.strerror(number) for number in (errno.ECONNREFUSED, errno.ECONNRESET, errno.EHOSTUNREACH, errno.ENETUNREACH)
    )
    return next((words for words in known if words in text), "the host is not found or does not answer")


class _RecordingSession(requests.Session):
    """HTTP session that retains the collector's answer, which the exporter only logs."""

    outcome = "nothing was sent"

    def request(self, *arguments: Any, **options: Any) -> requests.Response:
        try:
            answer = super().request(*arguments, **options)
        except requests.RequestException as error:
            self.outcome = describe_request_error(error)
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
