"""Spans of requests for OpenTelemetry: an optional extra, on where ROAM_OTLP_ENDPOINT names a collector."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Protocol

from roam_serving.settings import ServerSettings, SettingsError


class Span(Protocol):
    """What is told of a request while it runs."""

    def set_attribute(self, key: str, value: Any) -> None: ...


class Tracing:
    """Opens a span around every request; the one that a caller's `traceparent` names is its parent."""

    def __init__(self, settings: ServerSettings, service: str) -> None:
        self._provider: Any = None
        if settings.otlp_endpoint:
            self._provider = _provider(settings.otlp_endpoint, service)
            self._tracer = self._provider.get_tracer("roam")

    @contextmanager
    def span(self, name: str, headers: Mapping[str, str]) -> Iterator[Span | None]:
        """A span until the block ends, as the current one; None, at no cost, where nothing is traced."""
        if self._provider is None:
            yield None
            return
        from opentelemetry.trace import SpanKind
        from opentelemetry.trace.propagation.tracecontext import TraceContextTextMapPropagator

        parent = TraceContextTextMapPropagator().extract(dict(headers))
        with self._tracer.start_as_current_span(name, context=parent, kind=SpanKind.SERVER) as span:
            yield span

    def close(self) -> None:
        """Sends what is still to be sent."""
        if self._provider is not None:
            self._provider.shutdown()


def _provider(endpoint: str, service: str) -> Any:
    try:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
        from opentelemetry.sdk.resources import Resource
        from opentelemetry.sdk.trace import TracerProvider
        from opentelemetry.sdk.trace.export import BatchSpanProcessor
    except ModuleNotFoundError as error:
        raise SettingsError(
            f"--otlp-endpoint needs {error.name}, which is not installed: pip install 'roam-services[telemetry]'"
        ) from error
    provider = TracerProvider(resource=Resource.create({"service.name": f"roam-{service}"}))
    provider.add_span_processor(BatchSpanProcessor(OTLPSpanExporter(endpoint=endpoint)))
    return provider
