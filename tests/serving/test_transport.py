"""TLS and mutual TLS over real connections, and the refusal to listen in the open."""

import asyncio
import ssl

import grpc
import httpx
import pytest
import trustme
from echo import Echo
from roam.v1 import server_pb2, server_pb2_grpc
from roam_client import AccessDeniedError, AsyncClient, Client, ConnectionFailedError
from roam_serving.keys import add_key
from roam_serving.server import running
from roam_serving.settings import ServerSettings, SettingsError
from roam_serving.transport import is_loopback, transport_security


class Certificates:
    """An authority with files for a server and a client of it."""

    def __init__(self, folder):
        self.authority = trustme.CA()
        self.ca = folder / "ca.pem"
        self.authority.cert_pem.write_to_path(self.ca)
        self.server = self.issue(folder / "server", "127.0.0.1", "localhost")
        self.client = self.issue(folder / "client", "client.example")
        self.stranger = self.issue(folder / "stranger", "client.example", authority=trustme.CA())

    def issue(self, stem, *names, authority=None):
        made = (authority or self.authority).issue_cert(*names)
        cert, key = stem.with_suffix(".pem"), stem.with_suffix(".key")
        made.private_key_pem.write_to_path(key)
        for blob in made.cert_chain_pems:
            blob.write_to_path(cert, append=True)
        return cert, key

    def settings(self, *, mutual=False, **others):
        cert, key = map(str, self.server)
        return ServerSettings(tls_cert=cert, tls_key=key, tls_client_ca=str(self.ca) if mutual else "", **others)

    def context(self, pair=None):
        context = ssl.create_default_context(cafile=self.ca)
        if pair:
            context.load_cert_chain(*pair)
        return context


@pytest.fixture(scope="module")
def certificates(tmp_path_factory):
    return Certificates(tmp_path_factory.mktemp("certificates"))


async def services_of(addresses, **security):
    async with AsyncClient(goalpose=addresses.grpc, timeout=10, **security) as client:
        return (await client.server_info("goalpose")).services


async def test_both_ports_speak_tls(certificates):
    async with running([Echo()], certificates.settings()) as addresses:
        assert addresses.http.startswith("https://127.0.0.1:")
        async with httpx.AsyncClient(base_url=addresses.http, verify=certificates.context()) as client:
            assert (await client.get("/readyz")).status_code == 200
        assert await services_of(addresses, ca=certificates.ca) == ("echo",)


async def test_a_client_without_tls_or_with_another_authority_gets_nowhere(certificates, tmp_path):
    other = tmp_path / "other.pem"
    trustme.CA().cert_pem.write_to_path(other)
    async with running([Echo()], certificates.settings()) as addresses:
        for security in ({}, {"ca": other}):
            with pytest.raises(ConnectionFailedError):
                await services_of(addresses, **security)
        async with httpx.AsyncClient(base_url=addresses.http) as client:
            with pytest.raises(httpx.ConnectError):
                await client.get("/livez")


async def test_mutual_tls_asks_for_a_certificate_of_the_authority(certificates):
    async with running([Echo()], certificates.settings(mutual=True)) as addresses:
        assert await services_of(addresses, ca=certificates.ca, cert=certificates.client) == ("echo",)
        verify = certificates.context(certificates.client)
        async with httpx.AsyncClient(base_url=addresses.http, verify=verify) as client:
            assert (await client.get("/livez")).status_code == 200
        for pair in (None, certificates.stranger):
            with pytest.raises(ConnectionFailedError):
                await services_of(addresses, ca=certificates.ca, cert=pair)
            async with httpx.AsyncClient(base_url=addresses.http, verify=certificates.context(pair)) as client:
                with pytest.raises(httpx.TransportError):
                    await client.get("/livez")


async def test_a_key_goes_through_tls(certificates, tmp_path):
    key = add_key(tmp_path / "keys", "studio")
    async with running([Echo()], certificates.settings(api_keys=str(tmp_path / "keys"))) as addresses:
        assert await services_of(addresses, ca=certificates.ca, api_key=key) == ("echo",)
        with pytest.raises(AccessDeniedError) as caught:
            await services_of(addresses, ca=certificates.ca, api_key="roam_guess")
    assert caught.value.reason == "API_KEY_UNKNOWN"


async def test_the_client_for_ordinary_code_shows_key_and_certificate_too(certificates, tmp_path):
    key = add_key(tmp_path / "keys", "studio")

    def ask(addresses):
        with Client(
            motion=addresses.grpc, ca=certificates.ca, cert=certificates.client, api_key=key, timeout=10
        ) as client:
            return client.server_info("motion").services

    settings = certificates.settings(mutual=True, api_keys=str(tmp_path / "keys"))
    async with running([Echo()], settings) as addresses:
        assert await asyncio.to_thread(ask, addresses) == ("echo",)


async def test_grpc_without_our_client(certificates):
    credentials = grpc.ssl_channel_credentials(certificates.ca.read_bytes())
    async with (
        running([Echo()], certificates.settings()) as addresses,
        grpc.aio.secure_channel(addresses.grpc, credentials) as channel,
    ):
        stub = server_pb2_grpc.ServerServiceStub(channel)
        assert (await stub.GetServerInfo(server_pb2.GetServerInfoRequest())).services == ["echo"]


@pytest.mark.parametrize(
    ("host", "near"),
    [("127.0.0.1", True), ("127.0.0.9", True), ("::1", True), ("localhost", True), ("0.0.0.0", False), ("::", False)],
)
def test_only_loopback_may_go_without_tls(host, near):
    assert is_loopback(host) is near
    settings = ServerSettings(host=host)
    if near:
        assert transport_security(settings) is None
    else:
        with pytest.raises(SettingsError, match="--allow-insecure"):
            transport_security(settings)
    assert transport_security(ServerSettings(host=host, allow_insecure=True)) is None


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"tls_cert": "a.pem"}, "give both"),
        ({"tls_client_ca": "a.pem"}, "own certificate"),
        ({"tls_cert": "a.pem", "tls_key": "a.key"}, "no file a.pem"),
    ],
)
def test_settings_that_do_not_fit_are_explained(fields, words):
    with pytest.raises(SettingsError, match=words):
        transport_security(ServerSettings(**fields))
