"""Settings that every server has: addresses, limits, logs. Read from arguments, then ROAM_… environment variables."""

from typing import Literal

from pydantic import Field
from pydantic_settings import BaseSettings, SettingsConfigDict

MIB = 1 << 20


class SettingsError(ValueError):
    """Settings that no server can run with, in words for whoever starts it."""


class ServerSettings(BaseSettings):
    """What one server process needs to know before it starts."""

    model_config = SettingsConfigDict(env_prefix="ROAM_", cli_kebab_case=True, extra="ignore", frozen=True)

    host: str = Field("127.0.0.1", description="address to listen on; loopback unless you say otherwise")
    http_port: int = Field(0, ge=0, le=65535, description="HTTP port; 0 takes a free one")
    grpc_port: int = Field(0, ge=0, le=65535, description="gRPC port; 0 takes a free one")
    max_upload_bytes: int = Field(64 * MIB, gt=0, description="largest request body or upload [bytes]")
    drain_seconds: float = Field(10.0, ge=0, description="how long running requests may finish after SIGTERM [s]")
    cors_origin_regex: str = Field(
        r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?", description="web pages that may call, as an expression"
    )
    allowed_hosts: str = Field(
        "localhost,127.0.0.1,[::1]",
        description="names (Host) under which callers may ask, with commas; * for any: keeps out pages whose own name "
        "leads here",
    )
    tls_cert: str = Field("", description="certificate chain (PEM); with it both ports speak TLS")
    tls_key: str = Field("", description="private key of the certificate (PEM)")
    tls_client_ca: str = Field("", description="authority (PEM) that clients' certificates must come from: mutual TLS")
    api_keys: str = Field(
        "", description="file of hashed API keys (python -m roam_serving.keys); empty: no key is asked"
    )
    requests_per_second: float = Field(0.0, ge=0, description="requests of one API key or address; 0: no limit")
    request_burst: int = Field(20, ge=1, description="requests that may come at once before the rate counts")
    allow_insecure: bool = Field(False, description="listen beyond this machine without TLS")
    log_level: Literal["debug", "info", "warning", "error"] = Field("info", description="least level that is logged")
    log_format: Literal["json", "console"] = Field("json", description="one JSON object a line, or text for people")
    otlp_endpoint: str = Field("", description="OTLP/HTTP address that traces go to: http://localhost:4318/v1/traces")
    torch_threads: int = Field(1, ge=1, description="threads of one tensor operation; more is slower on a busy machine")
