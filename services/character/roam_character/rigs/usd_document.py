"""USD to a glTF document, by usd-core (UsdSkel). Run as a program in a process of its own: `python -m … FILE OUT.glb`.

Read: the first skeleton with its rest and bind transforms, the meshes bound to it (points, normals, texture
coordinates, display colour). metersPerUnit and upAxis are obeyed.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from roam_character.documents.gltf_document import GltfDocument, decompose


def usd_document(path: Path) -> GltfDocument:
    """Nodes for the joints and one skinned mesh for each bound one; metres, +Y up. Raises ValueError."""
    from pxr import Usd, UsdGeom, UsdSkel

    stage = Usd.Stage.Open(str(path))
    skeleton = next((UsdSkel.Skeleton(p) for p in stage.Traverse() if p.IsA(UsdSkel.Skeleton)), None)
    if skeleton is None:
        raise ValueError("it holds no UsdSkel skeleton")
    names = [str(name) for name in skeleton.GetJointsAttr().Get() or []]
    rest, bind = (
        np.array(a.Get() or []).reshape(-1, 4, 4).transpose(0, 2, 1)
        for a in (skeleton.GetRestTransformsAttr(), skeleton.GetBindTransformsAttr())
    )
    if not names or len(bind) != len(names):
        raise ValueError("its skeleton has no joints with bind transforms")
    document, to_world = GltfDocument(), _to_metres(stage, UsdGeom)
    space = to_world @ _world(skeleton.GetPrim(), UsdGeom)
    parents = [_parent(names, name) for name in names]
    if len(rest) != len(names):
        rest = np.stack([bind[i] if p < 0 else np.linalg.inv(bind[p]) @ bind[i] for i, p in enumerate(parents)])
    for index, name in enumerate(names):
        translation, rotation, scale = decompose(space @ rest[index] if parents[index] < 0 else rest[index])
        children = [c for c, p in enumerate(parents) if p == index]
        node = {"name": name.rsplit("/", 1)[-1], "translation": translation.tolist(), "rotation": rotation.tolist()}
        node |= {} if np.allclose(scale, 1, atol=1e-6) else {"scale": scale.tolist()}
        document.add("nodes", {**node, **({"children": children} if children else {})})
    roots = [i for i, p in enumerate(parents) if p < 0]
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Mesh):
            part = _add_mesh(document, prim, names, bind, to_world)
            roots += [] if part is None else [part]
    document.add("scenes", {"nodes": roots})
    document.json["scene"] = 0
    return document


def _parent(names: list[str], name: str) -> int:
    above = name.rpartition("/")[0]
    while above and above not in names:
        above = above.rpartition("/")[0]
    return names.index(above) if above else -1


def _to_metres(stage: Any, geometry: Any) -> np.ndarray:
    scale = geometry.GetStageMetersPerUnit(stage)
    turn = np.eye(4)
    if geometry.GetStageUpAxis(stage) == "Z":
        turn[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    return np.diag([scale, scale, scale, 1.0]) @ turn


def _world(prim: Any, geometry: Any) -> np.ndarray:
    return np.array(geometry.Xformable(prim).ComputeLocalToWorldTransform(0)).T


def _add_mesh(
    document: GltfDocument, prim: Any, names: list[str], bind: np.ndarray, to_world: np.ndarray
) -> int | None:
    """A mesh with its skin; answers its node. None for a mesh that is not bound to the skeleton."""
    from pxr import UsdGeom, UsdSkel

    mesh, binding = UsdGeom.Mesh(prim), UsdSkel.BindingAPI(prim)
    indices, weights = binding.GetJointIndicesPrimvar(), binding.GetJointWeightsPrimvar()
    points = np.array(mesh.GetPointsAttr().Get() or [], float)
    if not len(points) or not indices or not indices.HasValue():
        return None
    width = max(1, indices.GetElementSize())
    slots, parts = (np.array(p.Get()).reshape(-1, width) for p in (indices, weights))
    if indices.GetInterpolation() == "constant":
        slots, parts = (np.tile(a, (len(points), 1)) for a in (slots, parts))
    own = [str(name) for name in binding.GetJointsAttr().Get() or names]
    slots = np.array([names.index(name) if name in names else 0 for name in own])[slots]
    slots, parts = _heaviest(slots, parts)
    counts, corners = np.array(mesh.GetFaceVertexCountsAttr().Get()), np.array(mesh.GetFaceVertexIndicesAttr().Get())
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    flat = np.concatenate([(s + np.array([[0, k, k + 1]])).ravel() for s, n in zip(starts, counts, strict=True)
                           for k in range(1, n - 1)])  # fmt: skip
    if mesh.GetOrientationAttr().Get() == "leftHanded":
        flat = flat.reshape(-1, 3)[:, ::-1].reshape(-1)
    geometry = np.array(binding.GetGeomBindTransformAttr().Get() or np.eye(4)).T
    attributes = {
        "POSITION": document.accessor(points[corners[flat]], target=34962, bounds=True),
        "JOINTS_0": document.accessor(slots[corners[flat]], "H", target=34962),
        "WEIGHTS_0": document.accessor(parts[corners[flat]], target=34962),
    }
    colour = mesh.GetDisplayColorAttr().Get()
    material = document.material(prim.GetName(), (*(colour[0] if colour else (0.8, 0.8, 0.8)), 1.0))
    shape = {"name": prim.GetName(), "primitives": [{"attributes": attributes, "material": material}]}
    inverse = np.linalg.inv(bind) @ geometry
    skin = {
        "joints": list(range(len(names))),
        "inverseBindMatrices": document.accessor(inverse.transpose(0, 2, 1)),
    }
    translation, rotation, scale = decompose(to_world @ _world(prim, UsdGeom))
    node = {"name": prim.GetName() + "_mesh", "mesh": document.add("meshes", shape)}
    node |= {"translation": translation.tolist(), "rotation": rotation.tolist(), "scale": scale.tolist()}
    return document.add("nodes", {**node, "skin": document.add("skins", skin)})


def _heaviest(slots: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The four heaviest influences of every point, as parts of 1."""
    order = np.argsort(-weights, axis=1)[:, :4]
    slots, weights = np.take_along_axis(slots, order, 1), np.take_along_axis(weights, order, 1)
    pad = ((0, 0), (0, 4 - slots.shape[1]))
    slots, weights = np.pad(slots, pad), np.pad(weights.astype(float), pad)
    total = weights.sum(axis=1, keepdims=True)
    weights = np.where(total > 1e-9, weights / np.maximum(total, 1e-9), [1.0, 0, 0, 0])
    return np.where(weights > 0, slots, 0), weights


def main(arguments: list[str]) -> int:
    """Writes the GLB, or {"error": …} on stdout with status 1."""
    try:
        Path(arguments[1]).write_bytes(usd_document(Path(arguments[0])).to_bytes())
    except Exception as error:  # the caller only sees this process's end
        sys.stdout.write(json.dumps({"error": str(error).strip()}))
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
