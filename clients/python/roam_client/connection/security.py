"""TLS and API keys of a client's channels: shared by both clients."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import grpc


class OpensChannels(Protocol):
    """The modules `grpc` and `grpc.aio`, as far as channels go."""

    def secure_channel(self, target: str, credentials: grpc.ChannelCredentials, *, options: Any) -> Any: ...
    def insecure_channel(self, target: str, *, options: Any) -> Any: ...


@dataclass(frozen=True)
class Security:
    """What a client shows and what it asks of the server.

    `ca`: file (PEM) of the authority that signed the server's certificate; turns TLS on. `cert`: files (PEM) of the
    client's own certificate and its key, for servers with mutual TLS; turns TLS on. `credentials`: gRPC's own object
    instead of the two. `api_key` goes with every call; without TLS whoever listens on the network can read it.
    """

    api_key: str | None = None
    ca: str | Path | None = None
    cert: tuple[str | Path, str | Path] | None = None
    credentials: grpc.ChannelCredentials | None = None

    def channel(self, module: OpensChannels, target: str, options: Any) -> "MetadataChannel":
        """A channel to `target` (host:port), of `grpc` or `grpc.aio`. OSError when a file cannot be read."""
        credentials = self.credentials or self._tls()
        if credentials is None:
            channel = module.insecure_channel(target, options=options)
        else:
            channel = module.secure_channel(target, credentials, options=options)
        metadata = () if self.api_key is None else (("authorization", f"Bearer {self.api_key}"),)
        return MetadataChannel(channel, metadata)

    def _tls(self) -> grpc.ChannelCredentials | None:
        if self.ca is None and self.cert is None:
            return None
        roots = Path(self.ca).read_bytes() if self.ca is not None else None  # None: the authorities gRPC brings along
        chain, key = (Path(path).read_bytes() for path in self.cert) if self.cert else (None, None)
        return grpc.ssl_channel_credentials(root_certificates=roots, private_key=key, certificate_chain=chain)


class MetadataChannel:
    """A channel that sends some metadata with every call.

    gRPC's call credentials would do the same for a key but refuse to work without TLS, as behind a proxy on the same
    machine.
    """

    def __init__(self, channel: Any, metadata: tuple[tuple[str, str], ...]) -> None:
        self._channel = channel
        self._metadata = metadata

    def with_metadata(self, key: str, value: str) -> "MetadataChannel":
        """The same connection, with one more pair."""
        return MetadataChannel(self._channel, (*self._metadata, (key, value)))

    def unary_unary(self, *args: Any, **keywords: Any) -> Any:
        """As the channel's, with the metadata."""
        return partial(self._channel.unary_unary(*args, **keywords), metadata=self._metadata)

    def unary_stream(self, *args: Any, **keywords: Any) -> Any:
        """As the channel's, with the metadata."""
        return partial(self._channel.unary_stream(*args, **keywords), metadata=self._metadata)

    def stream_unary(self, *args: Any, **keywords: Any) -> Any:
        """As the channel's, with the metadata."""
        return partial(self._channel.stream_unary(*args, **keywords), metadata=self._metadata)

    def stream_stream(self, *args: Any, **keywords: Any) -> Any:
        """As the channel's, with the metadata."""
        return partial(self._channel.stream_stream(*args, **keywords), metadata=self._metadata)

    def close(self) -> Any:
        """Closes the channel; a coroutine where the channel's own is one."""
        return self._channel.close()
