"""Whether the ports speak TLS, and whether a server may listen where it is told to."""

import ipaddress
import ssl
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import grpc

from roam_serving.settings import ServerSettings, SettingsError


@dataclass(frozen=True)
class Tls:
    """Certificate files (PEM); with a `client_ca` only clients that hold a certificate of it get in."""

    cert: Path
    key: Path
    client_ca: Path | None

    def grpc_credentials(self) -> grpc.ServerCredentials:
        """For grpc's secure port."""
        roots = self.client_ca.read_bytes() if self.client_ca else None
        pair = (self.key.read_bytes(), self.cert.read_bytes())
        return grpc.ssl_server_credentials([pair], root_certificates=roots, require_client_auth=roots is not None)

    def uvicorn_options(self) -> dict[str, Any]:
        """For `uvicorn.Config`."""
        options: dict[str, Any] = {"ssl_certfile": str(self.cert), "ssl_keyfile": str(self.key)}
        if self.client_ca:
            options |= {"ssl_ca_certs": str(self.client_ca), "ssl_cert_reqs": ssl.CERT_REQUIRED}
        return options


def transport_security(settings: ServerSettings) -> Tls | None:
    """What the settings ask for; None: no encryption.

    SettingsError when they do not fit together, name a file that is not there, or
    would open a port beyond this machine without TLS and without `allow_insecure`.
    """
    if bool(settings.tls_cert) != bool(settings.tls_key):
        raise SettingsError("--tls-cert and --tls-key belong together: give both")
    if settings.tls_client_ca and not settings.tls_cert:
        raise SettingsError("--tls-client-ca needs the server's own certificate too: --tls-cert and --tls-key")
    if not settings.tls_cert:
        _check_plain(settings)
        return None
    client_ca = Path(settings.tls_client_ca) if settings.tls_client_ca else None
    tls = Tls(Path(settings.tls_cert), Path(settings.tls_key), client_ca)
    for path in (tls.cert, tls.key, tls.client_ca):
        if path is not None and not path.is_file():
            raise SettingsError(f"there is no file {path}")
    return tls


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches `host`."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _check_plain(settings: ServerSettings) -> None:
    if is_loopback(settings.host) or settings.allow_insecure:
        return
    raise SettingsError(
        f"--host {settings.host} is reachable from other machines: give --tls-cert and --tls-key, or say "
        "--allow-insecure (ROAM_ALLOW_INSECURE=1) when a proxy or a private network protects the ports"
    )
