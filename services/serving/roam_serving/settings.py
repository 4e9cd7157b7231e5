"""Settings that every server has: addresses, limits, logs. Read from arguments, then ROAM_… environment variables."""

import difflib
import importlib
import os
import re
from collections.abc import Mapping
from importlib.util import find_spec
from typing import Any, Literal, TypeVar

from pydantic import Field, ValidationError
from pydantic_settings import BaseSettings, SettingsConfigDict

MIB = 1 << 20
PREFIX = "ROAM_"
# Variables of this name that are no settings of a server: of the client, the scripts, compose and the tests.
OTHER_VARIABLES = frozenset(
    PREFIX + name
    for name in (
        "API_KEY",
        "CACHE",
        "DATA",
        "ENGINE_SCRIPTS",
        "FUZZ_EXAMPLES",
        "GRAFANA_PORT",
        "PORT",
        "PROMETHEUS_PORT",
        "REDIS_PASSWORD",
    )
) | {"ROAM_BLENDER", "ROAM_TORCH_INDEX"}
# What Kubernetes sets in every container for a Service that is called roam-something.
_KUBERNETES = re.compile(r"_SERVICE_HOST=|_SERVICE_PORT(_\w+)?=|_PORT_\d+_(TCP|UDP)(_\w+)?=|_PORT=(tcp|udp)://")
_SETTINGS_MODULES = ("roam_goalpose.settings", "roam_motion.settings")


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
    rate_store: str = Field(
        "",
        pattern=r"^((redis|rediss|unix)://.+)?$",
        description="redis://… where several replicas count these together; empty: each counts on its own",
    )
    allow_insecure: bool = Field(False, description="listen beyond this machine without TLS")
    log_level: Literal["debug", "info", "warning", "error"] = Field("info", description="least level that is logged")
    log_format: Literal["json", "console"] = Field("json", description="one JSON object a line, or text for people")
    otlp_endpoint: str = Field("", description="OTLP/HTTP address that traces go to: http://localhost:4318/v1/traces")
    torch_threads: int = Field(1, ge=1, description="threads of one tensor operation; more is slower on a busy machine")


Settings = TypeVar("Settings", bound=ServerSettings)


def read_settings(kind: type[Settings], **values: Any) -> Settings:
    """The settings of a server from `values`, then the environment.

    SettingsError, one sentence, when a value is wrong or a ROAM_… variable is no setting of any server: a name with a
    slip in it would silently change nothing.
    """
    check_environment(os.environ)
    try:
        return kind(**values)
    except ValidationError as error:
        raise SettingsError("; ".join(_complaint(kind, item) for item in error.errors())) from error


def check_environment(environment: Mapping[str, str]) -> None:
    """SettingsError naming the ROAM_… variables that no server, client or script reads."""
    known = setting_names() | OTHER_VARIABLES
    for name in sorted(environment):
        if name.startswith(PREFIX) and name not in known and not _foreign(name, environment[name]):
            raise SettingsError(f"{name} is set but no setting has this name; {_hint(name, known)}")


def _hint(name: str, known: set[str]) -> str:
    bare = [item.removeprefix(PREFIX) for item in known]
    near = difflib.get_close_matches(name.removeprefix(PREFIX), bare, n=1)
    return f"did you mean {PREFIX}{near[0]}?" if near else "`python -m roam_goalpose.app --help` lists the settings."


def setting_names() -> set[str]:
    """The variables of every server that is installed: a machine that runs both may set both's for each."""
    for module in _SETTINGS_MODULES:
        if find_spec(module.partition(".")[0]) is not None:
            importlib.import_module(module)
    kinds: list[type[ServerSettings]] = [ServerSettings]
    for kind in kinds:
        kinds.extend(kind.__subclasses__())
    return {PREFIX + field.upper() for kind in kinds for field in kind.model_fields}


def _foreign(name: str, value: str) -> bool:
    return name.startswith("ROAM_TEST_") or _KUBERNETES.search(f"{name}={value}") is not None


def _complaint(kind: type[ServerSettings], item: Any) -> str:
    """One wrong value, by the name under which it was given."""
    field = str(item["loc"][0]) if item["loc"] else ""
    variable = PREFIX + field.upper()
    name = variable if os.environ.get(variable) == str(item["input"]) else "--" + field.replace("_", "-")
    purpose = f" ({kind.model_fields[field].description})" if field in kind.model_fields else ""
    return f"{name} cannot be {item['input']!r}: {item['msg'][:1].lower()}{item['msg'][1:]}{purpose}"
