"""What a server says about itself."""

from dataclasses import dataclass
from typing import Self

from roam.v1 import server_pb2


@dataclass(frozen=True)
class ServerInfo:
    """Version, loaded models (name -> hash of the weights) and limits by name."""

    version: str
    services: tuple[str, ...]
    models: dict[str, str]
    limits: dict[str, int]

    @classmethod
    def from_message(cls, message: server_pb2.GetServerInfoResponse) -> Self:
        """Decodes."""
        return cls(message.version, tuple(message.services), dict(message.models), dict(message.limits))
