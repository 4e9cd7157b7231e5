"""Pages of the site generated while it is built: the protocol from proto/, the HTTP interface from the servers."""

import asyncio
import json
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[1]


def on_files(files: Files, config: Any) -> Files:
    """Adds the generated pages; MkDocs calls it."""
    files.append(File.generated(config, "reference/protocol.md", content=_protocol()))
    files.append(File.generated(config, "reference/openapi.json", content=json.dumps(_openapi(), indent=1)))
    return files


def _protocol() -> str:
    about = "Generated from `proto/roam/v1`; `proto/README.md` tells how bytes are packed and how streams behave."
    parts = ["# Protocol", about]
    for path in sorted((ROOT / "proto/roam/v1").glob("*.proto")):
        parts += [f"## {path.name}", f"```proto\n{path.read_text().rstrip()}\n```"]
    return "\n\n".join(parts) + "\n"


def _openapi() -> dict[str, Any]:
    """What both services in one process answer at /openapi.json."""
    from roam_command.embedded import make_services
    from roam_serving.server import Server

    async def document() -> dict[str, Any]:  # a server is made inside an event loop
        services, settings = make_services("the site", http_port=0, grpc_port=0)
        found: dict[str, Any] = Server(services, settings).http_application().openapi()
        return found

    return asyncio.run(document())
