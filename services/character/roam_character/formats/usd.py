"""USD (.usd, .usda, .usdc, .usdz): a UsdSkel skeleton, the bound meshes, the motion as a SkelAnimation.

Metres, +Y up, a default prim, one SkelRoot with a mesh in it (readers find no bones without one). The animation names
every joint and has translations, rotations and scales: without `scales` usd-core 26.11 drops all of it silently.
Time codes start at 0 and the last pose is held once more at endTimeCode.
"""

import importlib.util
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from roam_character.documents.gltf_document import GltfDocument, GltfError, decompose, node_matrix, parents_first
from roam_character.formats.registry import Format
from roam_character.formats.scene import Furniture, Scene


def write(path: Path, scene: Scene) -> Sequence[str]:
    """Writes a scene; .usdz packs it."""
    from pxr import Sdf, Usd, UsdGeom, UsdUtils

    packed = path.suffix.lower() == ".usdz"
    inner = path.with_suffix(".usdc") if packed else path
    stage = Usd.Stage.CreateNew(str(inner))
    try:
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
        root = UsdGeom.Xform.Define(stage, "/Scene")
        stage.SetDefaultPrim(root.GetPrim())
        notes = _add_character(stage, scene)
        if scene.furniture is not None:
            _add_furniture(stage, scene.furniture)
        stage.GetRootLayer().Save()
        if packed and not UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(inner)), str(path)):
            raise OSError(f"usd-core could not pack {path.name}")
    finally:
        if packed:
            inner.unlink(missing_ok=True)
    return notes


def _missing() -> str:
    return "" if importlib.util.find_spec("pxr") else "usd-core (pip install usd-core)"


FORMAT = Format(
    "usd", "USD and USDZ (UsdSkel)", (".usd", ".usda", ".usdc", ".usdz"), write=write, furniture=True, missing=_missing
)


def _add_character(stage: Any, scene: Scene) -> Sequence[str]:
    from pxr import UsdGeom, UsdSkel

    document, joints, frames = _skeletal(scene)
    parents = document.node_parents()
    names = _joint_paths(document, joints, parents)
    root = UsdSkel.Root.Define(stage, "/Scene/Character")
    skeleton = UsdSkel.Skeleton.Define(stage, "/Scene/Character/Skeleton")
    worlds = document.node_worlds()
    binds = _binds(document, joints, worlds)
    top = [parents[j] in joints for j in joints]
    locals_ = [node_matrix(document.json["nodes"][j]) if inside else worlds[j]
               for j, inside in zip(joints, top, strict=True)]  # fmt: skip
    skeleton.CreateJointsAttr(names)
    skeleton.CreateBindTransformsAttr([_matrix(binds[j]) for j in joints])
    skeleton.CreateRestTransformsAttr([_matrix(m) for m in locals_])
    animation = UsdSkel.Animation.Define(stage, "/Scene/Character/Motion")
    animation.CreateJointsAttr(names)
    _add_keys(stage, animation, frames, still=scene.is_pose, rate=scene.clip.frame_rate)
    binding = UsdSkel.BindingAPI.Apply(skeleton.GetPrim())
    binding.CreateAnimationSourceRel().SetTargets([animation.GetPrim().GetPath()])
    kept = _add_skinned(stage, document, joints, skeleton)
    root.GetPrim()
    UsdGeom.Imageable(root).CreatePurposeAttr(UsdGeom.Tokens.default_)
    lost = ["USD keeps skeleton, skinned meshes and plain colours: textures and blend shapes are left out"]
    return [*lost, *(["some meshes of the character are compressed and were left out"] if not kept else [])]


def _skeletal(scene: Scene) -> tuple[GltfDocument, list[int], tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """The document with rest nodes, its joint nodes (parents first), and their frames: translations, rotations, scales.

    Joints whose parent is no joint get their whole placement, so that the skeleton stands without nodes above it.
    """
    from roam_character.formats.character_glb import character_document
    from roam_character.formats.glb import body_document

    if scene.character is None:
        clip = scene.clip
        document = body_document(clip, still=False)
        count = clip.skeleton.joint_count
        places = np.tile(clip.skeleton.rest_offsets.astype(float), (len(clip), 1, 1))
        places[:, 0] = clip.root_positions
        return document, list(range(count)), (places, clip.rotations.astype(float), np.ones((len(clip), count, 3)))
    motion = scene.character
    document = character_document(motion, still=False)
    rig, outer = motion.fit.rig, document.node_parents()
    worlds = document.node_worlds()
    order = [n for n in parents_first(outer) if n in rig.nodes]
    place = [rig.nodes.index(n) for n in order]
    scales = np.tile(motion.scales[place], (len(motion), 1, 1))
    moves, turns = motion.translations[:, place].copy(), motion.rotations[:, place].copy()
    for index, node in enumerate(order):
        above = outer[node]
        if above not in order and above >= 0:
            local = worlds[above] @ _composed(moves[:, index], turns[:, index], scales[:, index])
            moves[:, index], turns[:, index], scales[:, index] = decompose(local)
    return document, order, (moves, turns, scales)


def _composed(place: np.ndarray, turn: np.ndarray, size: np.ndarray) -> np.ndarray:
    from roam_character.documents.gltf_document import compose

    return compose(place, turn, size)


def _joint_paths(document: GltfDocument, joints: list[int], parents: list[int]) -> list[str]:
    """Joint tokens as USD wants them: paths of valid names, each once."""
    paths: dict[int, str] = {}
    for node in joints:
        own = usd_name(str(document.json["nodes"][node].get("name", f"joint_{node}")))
        above = paths.get(parents[node])
        path = own if above is None else f"{above}/{own}"
        paths[node] = path if path not in paths.values() else f"{path}_{node}"
    return [paths[node] for node in joints]


def usd_name(name: str) -> str:
    """A name as a USD identifier: other characters become underscores."""
    plain = "".join(c if c.isalnum() and c.isascii() else "_" for c in name) or "_"
    return plain if not plain[0].isdigit() else f"_{plain}"


def _matrix(matrix: np.ndarray) -> Any:
    from pxr import Gf

    return Gf.Matrix4d(*np.asarray(matrix, float).T.reshape(-1).tolist())


def _binds(document: GltfDocument, joints: list[int], worlds: np.ndarray) -> dict[int, np.ndarray]:
    """Bind placement of every joint in its mesh's space; rest where no skin names it."""
    found = {node: worlds[node] for node in joints}
    for skin in document.json.get("skins", []):
        if "inverseBindMatrices" in skin:
            inverse = document.values(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
            for node, matrix in zip(skin["joints"], inverse, strict=False):
                if node in found and abs(np.linalg.det(matrix)) > 1e-12:
                    found[node] = np.linalg.inv(matrix)
    return found


def _add_keys(
    stage: Any, animation: Any, frames: tuple[np.ndarray, np.ndarray, np.ndarray], *, still: bool, rate: float
) -> None:
    from pxr import Gf, Usd, Vt

    moves, turns, sizes = frames
    turns = turns / np.linalg.norm(turns, axis=-1, keepdims=True)
    places, spins, scales = (
        animation.CreateTranslationsAttr(),
        animation.CreateRotationsAttr(),
        animation.CreateScalesAttr(),
    )
    for frame in range(len(moves)):
        code = Usd.TimeCode.Default() if still else Usd.TimeCode(frame)
        places.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(moves[frame], np.float32)), code)
        spins.Set(
            Vt.QuatfArray([Gf.Quatf(float(w), float(x), float(y), float(z)) for x, y, z, w in turns[frame]]), code
        )
        scales.Set(Vt.Vec3hArray([Gf.Vec3h(*map(float, s)) for s in sizes[frame]]), code)
    if not still:
        for attribute in (
            places,
            spins,
            scales,
        ):  # readers that end a clip at the last sample would drop the last frame
            attribute.Set(attribute.Get(len(moves) - 1), Usd.TimeCode(len(moves)))
        stage.SetStartTimeCode(0)
        stage.SetEndTimeCode(len(moves))
        stage.SetTimeCodesPerSecond(rate)
        stage.SetFramesPerSecond(rate)


def _add_skinned(stage: Any, document: GltfDocument, joints: list[int], skeleton: Any) -> bool:
    """The skinned meshes; whether all of them could be read."""
    from pxr import UsdSkel, Vt

    whole, place = True, {node: index for index, node in enumerate(joints)}
    for number, node in enumerate(document.json["nodes"]):
        if "skin" not in node or "mesh" not in node:
            continue
        slots = np.array([place.get(n, 0) for n in document.json["skins"][node["skin"]]["joints"]])
        mesh = document.json["meshes"][node["mesh"]]
        for part, primitive in enumerate(mesh["primitives"]):
            name = usd_name(f"{node.get('name', 'mesh')}_{number}_{part}")
            try:
                prim = _add_mesh(stage, f"/Scene/Character/{name}", document, primitive)
                own, weights = (document.values(primitive["attributes"][a]) for a in ("JOINTS_0", "WEIGHTS_0"))
            except (GltfError, KeyError):
                whole = False
                continue
            binding = UsdSkel.BindingAPI.Apply(prim)
            binding.CreateSkeletonRel().SetTargets([skeleton.GetPrim().GetPath()])
            total = np.maximum(weights.sum(axis=1, keepdims=True), 1e-9)
            binding.CreateJointIndicesPrimvar(False, 4).Set(
                Vt.IntArray.FromNumpy(slots[own].reshape(-1).astype(np.int32))
            )
            binding.CreateJointWeightsPrimvar(False, 4).Set(
                Vt.FloatArray.FromNumpy((weights / total).reshape(-1).astype(np.float32))
            )
    return whole


def _add_mesh(stage: Any, path: str, document: GltfDocument, primitive: dict[str, Any]) -> Any:
    """One primitive of triangles (or a cloud) with normals, texture coordinates and its base colour."""
    from pxr import Gf, Sdf, UsdGeom, Vt

    if "extensions" in primitive:
        raise GltfError("compressed")
    attributes = primitive["attributes"]
    points = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(document.values(attributes["POSITION"]), np.float32))
    colour = _colour(document, primitive)
    if primitive.get("mode", 4) == 0:
        cloud = UsdGeom.Points.Define(stage, path)
        cloud.CreatePointsAttr(points)
        cloud.CreateWidthsAttr([0.01])
        cloud.CreateDisplayColorAttr([Gf.Vec3f(*colour)])
        return cloud.GetPrim()
    if primitive.get("mode", 4) != 4:
        raise GltfError("no triangles")
    mesh = UsdGeom.Mesh.Define(stage, path)
    corners = document.values(primitive["indices"])[:, 0] if "indices" in primitive else np.arange(len(points))
    mesh.CreatePointsAttr(points)
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(corners, np.int32)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(corners) // 3, 3, np.int32)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(True)
    mesh.CreateDisplayColorAttr([Gf.Vec3f(*colour)])
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
    if "NORMAL" in attributes:
        mesh.CreateNormalsAttr(
            Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(document.values(attributes["NORMAL"]), np.float32))
        )
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    if "TEXCOORD_0" in attributes:
        places = np.ascontiguousarray(document.values(attributes["TEXCOORD_0"]) * [1, -1] + [0, 1], np.float32)
        primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex")
        primvar.Set(Vt.Vec2fArray.FromNumpy(places))
    return mesh.GetPrim()


def _colour(document: GltfDocument, primitive: dict[str, Any]) -> tuple[float, float, float]:
    number = primitive.get("material")
    surface = {} if number is None else document.json["materials"][number].get("pbrMetallicRoughness", {})
    red, green, blue = surface.get("baseColorFactor", (0.8, 0.8, 0.8, 1.0))[:3]
    return float(red), float(green), float(blue)


def _add_furniture(stage: Any, furniture: Furniture) -> None:
    """The furniture's meshes in the world, each below a prim with its placement."""
    from pxr import UsdGeom

    document = furniture.document
    worlds = document.node_worlds()
    UsdGeom.Xform.Define(stage, "/Scene/Furniture").AddTransformOp().Set(_matrix(furniture.to_world))
    for number, node in enumerate(document.json.get("nodes", [])):
        if "mesh" not in node:
            continue
        path = f"/Scene/Furniture/{usd_name(str(node.get('name', 'part')))}_{number}"
        UsdGeom.Xform.Define(stage, path).AddTransformOp().Set(_matrix(worlds[number]))
        for part, primitive in enumerate(document.json["meshes"][node["mesh"]]["primitives"]):
            try:
                _add_mesh(stage, f"{path}/mesh_{part}", document, primitive)
            except (GltfError, KeyError):
                continue
