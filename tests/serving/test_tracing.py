"""Spans of requests, as a collector receives them over OTLP."""

import gzip
import sys
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer

import grpc
import httpx
import pytest
from echo import Echo
from roam.v1 import server_pb2, server_pb2_grpc
from roam_serving.monitoring.tracing import Tracing
from roam_serving.server import running
from roam_serving.settings import ServerSettings, SettingsError

TRACE = "0af7651916cd43dd8448eb211c80319c"
PARENT = f"00-{TRACE}-b7ad6b7169203331-01"


@pytest.fixture
def collector():
    """An OTLP collector on loopback: its address and the bodies that came."""
    bodies: list[bytes] = []

    class Collect(BaseHTTPRequestHandler):
        def do_POST(self):
            body = self.rfile.read(int(self.headers["Content-Length"]))
            if self.headers.get("Content-Encoding") == "gzip":
                body = gzip.decompress(body)
            bodies.append(body)
            self.send_response(200)
            self.end_headers()

        def log_message(self, *arguments):
            pass

    with HTTPServer(("127.0.0.1", 0), Collect) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}/v1/traces", bodies
        server.shutdown()
        thread.join()


async def test_requests_of_both_transports_are_children_of_the_callers_span(collector):
    pytest.importorskip("opentelemetry.exporter.otlp.proto.http", reason="needs roam-services[telemetry]")
    from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest

    address, bodies = collector
    async with running([Echo()], ServerSettings(otlp_endpoint=address)) as addresses:
        async with httpx.AsyncClient(base_url=addresses.http) as client:
            await client.post("/number", json={"number": "x"}, headers={"traceparent": PARENT, "X-Request-Id": "mine"})
        async with grpc.aio.insecure_channel(addresses.grpc) as channel:
            stub = server_pb2_grpc.ServerServiceStub(channel)
            await stub.GetServerInfo(server_pb2.GetServerInfoRequest(), metadata=(("traceparent", PARENT),))
    spans, services = {}, set()
    for body in bodies:
        for resource in ExportTraceServiceRequest.FromString(body).resource_spans:
            services |= {a.value.string_value for a in resource.resource.attributes if a.key == "service.name"}
            spans |= {span.name: span for scope in resource.scope_spans for span in scope.spans}
    assert services == {"roam-echo"}
    assert set(spans) == {"POST /number", "roam.v1.ServerService/GetServerInfo"}
    assert {span.trace_id.hex() for span in spans.values()} == {TRACE}
    told = {a.key: a.value for a in spans["POST /number"].attributes}
    assert told["http.response.status_code"].int_value == 400
    assert told["roam.request_id"].string_value == "mine"


def test_without_a_collector_nothing_is_traced():
    with Tracing(ServerSettings(), "echo").span("x", {}) as span:
        assert span is None


def test_without_the_extra_the_start_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "opentelemetry.exporter.otlp.proto.http.trace_exporter", None)
    with pytest.raises(SettingsError, match="telemetry"):
        Tracing(ServerSettings(otlp_endpoint="http://127.0.0.1:1"), "echo")
