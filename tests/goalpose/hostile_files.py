"""Small files that promise, demand or hide something a reader must not fall for: (format, bytes) by name."""

import base64
import bz2
import gzip
import io
import json
import struct

import numpy as np
import trimesh
from poser import box_file


def glb(document: dict, binary: bytes = b"") -> bytes:
    """A GLB with any JSON."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    if binary:
        chunks += struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def gltf(*, uri: str | None = None, length: int = 36, count: int = 3, nodes: list | None = None, **more) -> dict:
    """A document with one triangle, or with lies about it."""
    triangle = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
    inline = "data:application/octet-stream;base64," + base64.b64encode(triangle).decode()
    return {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": length, "uri": inline if uri is None else uri}],
        "bufferViews": [{"buffer": 0, "byteLength": length}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "nodes": [{"mesh": 0}] if nodes is None else nodes,
        "scenes": [{"nodes": [0]}],
        "scene": 0,
        **more,
    }


def text(document: dict) -> bytes:
    return json.dumps(document).encode()


def npy(header: str, body: bytes = b"\0" * 96) -> bytes:
    data = header.encode() + b" " * (-(10 + len(header) + 1) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(data)) + data + body


def pickled() -> bytes:
    file = io.BytesIO()
    np.save(file, np.array([{"a": print}], dtype=object), allow_pickle=True)
    return file.getvalue()


def doubling(depth: int) -> list:
    """Nodes of which each shows the next one twice: 2^depth triangles in a kilobyte."""
    return [{"children": [n + 1, n + 2]} for n in range(depth)] + [{"mesh": 0}, {"mesh": 0}]


def obj(value: str) -> bytes:
    return f"v 0 0 0\nv 1 0 0\nv 0 {value} 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n".encode()


def cloud(value: float) -> bytes:
    points = np.random.default_rng(0).uniform(0, 1, (200, 3)).astype("<f4")
    points[:, 1] = value
    file = io.BytesIO()
    np.save(file, points)
    return file.getvalue()


BOMB = bz2.compress(bytes(45_000_000))  # 50 bytes that unpack to 45 MB
_XYZ = "property float x\nproperty float y\nproperty float z\n"
PLY = "ply\nformat binary_little_endian 1.0\nelement vertex {n}\n" + _XYZ + "end_header\n"
PCD = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {n}\nHEIGHT 1\nPOINTS {n}\nDATA {kind}\n"
BOX = box_file()

HOSTILE: dict[str, tuple[str, bytes]] = {
    # packed
    **{f"bz2 as {name}": (name, BOMB) for name in ("obj", "ply", "stl", "glb", "xyz", "npy", "pcd", "off", "gltf")},
    "gzip as obj": ("obj", gzip.compress(b"v 0 0 0\n" * 1_000_000)),
    "pickle in npy": ("npy", pickled()),
    # cut
    "half a GLB": ("glb", BOX[: len(BOX) // 2]),
    "GLB header alone": ("glb", BOX[:12]),
    "GLB that promises 4 GiB": ("glb", BOX[:8] + b"\xff\xff\xff\xff" + BOX[12:]),
    "GLB chunk beyond the end": ("glb", BOX[:12] + b"\xff\xff\xff\x7f" + BOX[16:]),
    # numbers
    **{f"OBJ with {value}": ("obj", obj(value)) for value in ("nan", "inf", "1e30", "1e400")},
    **{f"cloud with {value}": ("npy", cloud(value)) for value in (float("nan"), float("-inf"), 1e30)},
    # promises
    "PLY of 10^9 vertices": ("ply", PLY.format(n=10**9).encode() + b"\0" * 64),
    "ASCII PLY of 10^9": ("ply", PLY.replace("binary_little_endian", "ascii").format(n=10**9).encode() + b"0 0 0\n"),
    "OFF of 10^9 vertices": ("off", b"OFF\n1000000000 1000000000 0\n0 0 0\n"),
    "STL of 4·10^9 faces": ("stl", b"\0" * 80 + b"\xff\xff\xff\xff" + b"\0" * 50),
    "PCD of 10^9 points": ("pcd", PCD.format(n=10**9, kind="binary").encode() + b"\0" * 64),
    "compressed PCD of 4 GB": (
        "pcd",
        PCD.format(n=10**9, kind="binary_compressed").encode() + b"\x09\0\0\0\xff\xff\xff\xff" + b"\0" * 9,
    ),
    "NPY of 10^9 rows": ("npy", npy("{'descr': '<f4', 'fortran_order': False, 'shape': (1000000000, 3), }")),
    "NPY of a huge item": ("npy", npy("{'descr': '|V2000000000', 'fortran_order': False, 'shape': (3, 3), }")),
    "glTF accessor of 10^9": ("gltf", text(gltf(count=10**9))),
    "glTF buffer of 10^9 bytes": ("gltf", text(gltf(length=10**9))),
    "GLB accessor of 10^9": ("glb", glb(gltf(count=10**9))),
    "OBJ face of vertex 10^9": ("obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 1000000000\n"),
    # other files
    **{
        f"glTF buffer at {uri}": ("gltf", text(gltf(uri=uri)))
        for uri in ("chair.bin", "/etc/passwd", "file:///etc/passwd", "../../x.bin", "http://127.0.0.1:1/x")
    },
    # nesting
    "deep JSON": ("gltf", b'{"asset":{"version":"2.0"},"extras":' + b"[" * 100_000 + b"]" * 100_000 + b"}"),
    "deep open JSON": ("gltf", b"[" * 200_000),
    "nodes in a circle": ("gltf", text(gltf(nodes=[{"children": [1]}, {"children": [0], "mesh": 0}]))),
    "2^40 triangles by doubling": ("gltf", text(gltf(nodes=doubling(40)))),
    "a deep chain of nodes": ("gltf", text(gltf(nodes=[*({"children": [n + 1]} for n in range(20_000)), {"mesh": 0}]))),
    # geometry that is none
    "one triangle": ("gltf", text(gltf())),
    "a flat sheet": ("stl", trimesh.creation.box((0.5, 1e-9, 0.5)).export(file_type="stl")),
}
