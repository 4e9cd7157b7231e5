"""The page's own routes, without a browser."""

from pathlib import Path

import httpx
import numpy as np
import pytest
from fastapi import FastAPI
from roam_character.documents.gltf_document import GltfDocument
from roam_character.skeleton import humanoid_skeleton
from roam_command.page import PageService, Upload

ROOT = Path(__file__).parents[2]
CHAIR = ROOT / "examples/objects/chair.glb"
TRIANGLE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.fixture
def http() -> httpx.AsyncClient:
    app = FastAPI()
    app.include_router(PageService(Upload(CHAIR, unit="cm")).router())
    return httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://page")


async def test_the_page_loads_nothing_from_elsewhere(http: httpx.AsyncClient):
    page = await http.get("/")
    assert page.headers["content-type"].startswith("text/html")
    for name in ("main.js", "stage.js", "style.css", "vendor/three/three.module.js"):
        assert (await http.get(f"/viewer/{name}")).status_code == 200
    sources = [page.text, *(path.read_text() for path in (ROOT / "clients/python/roam_command/viewer").glob("*.js"))]
    outside = [line for text in sources for line in text.splitlines() if "://" in line and "w3.org" not in line]
    assert [line for line in outside if "${location.host}" not in line] == []


async def test_the_given_object_comes_first_and_the_bundled_ones_follow(http: httpx.AsyncClient):
    objects = (await http.get("/viewer/objects")).json()["objects"]
    assert objects[0] == {
        "title": "chair",
        "address": "/viewer/objects/0",
        "format": "glb",
        "unit": "cm",
        "up": None,
    }
    assert "sofa" in [item["title"] for item in objects[1:]]
    assert "chair" not in [item["title"] for item in objects[1:]]
    assert (await http.get("/viewer/objects/0")).content == CHAIR.read_bytes()
    assert (await http.get("/viewer/objects/99")).status_code == 404


async def test_triangles_come_as_plain_arrays(http: httpx.AsyncClient):
    answer = await http.post("/viewer/mesh?format=obj", content=TRIANGLE)
    assert np.frombuffer(answer.content[:8], "<u4").tolist() == [3, 1]
    corners = np.frombuffer(answer.content[8:44], "<f4").reshape(3, 3)
    assert corners.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert sorted(np.frombuffer(answer.content[44:], "<u4").tolist()) == [0, 1, 2]


async def test_a_point_cloud_has_points_and_no_faces(http: httpx.AsyncClient):
    points = np.random.default_rng(0).random((100, 3))
    answer = await http.post(
        "/viewer/mesh?format=xyz", content="\n".join(" ".join(map(str, p)) for p in points).encode()
    )
    assert np.frombuffer(answer.content[:8], "<u4").tolist() == [100, 0]


async def test_a_broken_file_is_refused_in_words(http: httpx.AsyncClient):
    answer = await http.post("/viewer/mesh?format=glb", content=b"nothing")
    assert answer.status_code == 422
    assert len(answer.json()["detail"]) > 20


@pytest.mark.parametrize("path", ["../page.py", "%2e%2e/page.py", "..%2f..%2fpyproject.toml", "nothing.js"])
async def test_only_the_pages_own_files_are_served(http: httpx.AsyncClient, path: str):
    assert (await http.get(f"/viewer/{path}")).status_code == 404


def shown(frames: int) -> bytes:
    """What the page sends: frames of somebody standing, then the furniture."""
    row = np.concatenate([[0, 0.96, 0], np.tile([0, 0, 0, 1], 22)]).astype("<f4")
    return np.array([frames, len(row)], "<u4").tobytes() + np.tile(row, (frames, 1)).tobytes() + CHAIR.read_bytes()


@pytest.mark.parametrize("frames", [1, 3])
@pytest.mark.parametrize("format", ["glb", "bvh", "vrma"])
async def test_what_was_shown_is_saved(http: httpx.AsyncClient, format: str, frames: int):
    query = {"format": format, "object_format": "glb", "transform": str(np.eye(4).tolist())}
    answer = await http.post("/viewer/save", params=query, content=shown(frames))
    assert answer.status_code == 200, answer.text
    assert answer.content.startswith(b"HIERARCHY" if format == "bvh" else b"glTF")
    assert (b'"object"' in answer.content) == (format == "glb")


@pytest.mark.parametrize(
    ("format", "content"), [("exe", shown(1)), ("glb", b""), ("glb", shown(1)[:40]), ("glb", b"\xff" * 400)]
)
async def test_what_cannot_be_saved_is_refused_in_words(http: httpx.AsyncClient, format: str, content: bytes):
    query = {"format": format, "object_format": "glb", "transform": str(np.eye(4).tolist())}
    answer = await http.post("/viewer/save", params=query, content=content)
    assert answer.status_code == 422
    assert len(answer.json()["detail"]) > 20


async def test_the_figure_has_the_joints_of_the_default_skeleton(http: httpx.AsyncClient):
    content = (await http.get("/viewer/figure.glb")).content
    document = GltfDocument.read(content)
    names = [node["name"] for node in document.json["nodes"]]
    assert names[:22] == list(humanoid_skeleton().joint_names)
    assert len(content) < 2_000_000
