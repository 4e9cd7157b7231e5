"""Prometheus metrics that every server has; services add their own to the same registry."""

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest
from prometheus_client.gc_collector import GCCollector
from prometheus_client.platform_collector import PlatformCollector
from prometheus_client.process_collector import ProcessCollector

_SECONDS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60)


class Metrics:
    """One registry per server, so that several servers (and tests) live in one process."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        for collector in (ProcessCollector, PlatformCollector, GCCollector):
            collector(registry=self.registry)
        self.requests = Counter(
            "roam_requests",
            "Requests answered, by transport (http, grpc), method and code.",
            ("transport", "method", "code"),
            registry=self.registry,
        )
        self.request_seconds = Histogram(
            "roam_request_seconds",
            "Time from request to end of answer.",
            ("transport", "method"),
            buckets=_SECONDS,
            registry=self.registry,
        )
        self.in_flight = Gauge(
            "roam_requests_in_flight", "Requests being answered.", ("transport",), registry=self.registry
        )

    def exposition(self) -> bytes:
        """All metrics in the Prometheus text format."""
        return generate_latest(self.registry)
