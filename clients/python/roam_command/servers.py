"""Where the services are: at given addresses, or started inside this process."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from roam_client import Client

from roam_command.options.shared import ServerChoice
from roam_command.reports import UsageError, stderr


@dataclass(frozen=True)
class Addresses:
    """gRPC addresses, host:port."""

    goalpose: str
    motion: str


def parse_server(text: str) -> Addresses:
    """`host:port`, or `goalpose=host:port,motion=host:port` in either order. UsageError for anything else."""
    if "=" not in text:
        return Addresses(_checked(text), _checked(text))
    pairs = dict(part.partition("=")[::2] for part in text.split(","))
    if set(pairs) != {"goalpose", "motion"}:
        raise UsageError(
            f"--server {text} does not name both services", remedy="Write goalpose=host:port,motion=host:port."
        )
    return Addresses(_checked(pairs["goalpose"]), _checked(pairs["motion"]))


def _checked(address: str) -> str:
    if "://" in address:
        raise UsageError(
            f"{address} is a web address",
            remedy="Write the gRPC address, host:port: what `roam serve` prints behind grpc=, such as localhost:50051.",
        )
    host, colon, port = address.strip().rpartition(":")
    if not (host and colon and port.isdigit() and 0 < int(port) < 65536):
        raise UsageError(
            f"{address or 'an empty text'} is not an address",
            remedy="Write the gRPC address as host:port, for example localhost:50051.",
        )
    return address.strip()


@contextmanager
def connected(to: ServerChoice) -> Iterator[Client]:
    """A client of both services; where no server is named they run inside this process until the block ends."""
    if to.server is not None:
        at = parse_server(to.server)
        with Client(goalpose=at.goalpose, motion=at.motion, **to.security) as client:
            yield client
        return
    from roam_command.embedded import embedded

    stderr.print("starting services (--server uses running ones) …", style="dim")
    with embedded() as address, Client(goalpose=address, motion=address) as client:
        yield client
