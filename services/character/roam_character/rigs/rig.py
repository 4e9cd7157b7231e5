"""A character as its file holds it: joints with their placements, the humanoid bones it declares, the file itself.

Whatever the format, the file is held as a glTF document (FBX, USD and BVH are turned into one): what is added or moved
later is added to that document, so that meshes, materials, skins and everything unknown stay as they were.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from roam_character.documents.gltf_document import GltfDocument, GltfError, node_matrix, parents_first

HUMANOID_BONES = (
    "hips", "spine", "chest", "upperChest", "neck", "head",
    "leftShoulder", "leftUpperArm", "leftLowerArm", "leftHand",
    "rightShoulder", "rightUpperArm", "rightLowerArm", "rightHand",
    "leftUpperLeg", "leftLowerLeg", "leftFoot", "leftToes",
    "rightUpperLeg", "rightLowerLeg", "rightFoot", "rightToes",
)  # fmt: skip
OPTIONAL_BONES = ("spine", "chest", "upperChest", "neck", "leftShoulder", "rightShoulder", "leftToes", "rightToes")
NEEDED_BONES = tuple(bone for bone in HUMANOID_BONES if bone not in OPTIONAL_BONES)


class RigError(ValueError):
    """A file that is no character that can be used; the message says why, `remedy` what to do."""

    def __init__(self, message: str, *, remedy: str = "") -> None:
        super().__init__(message)
        self.remedy = remedy


@dataclass(frozen=True, eq=False)
class Rig:
    """N joints of a character; matrices are in metres with +Y up, as the document's nodes are."""

    name: str
    format: str  # of the file: glb, vrm, fbx, bvh, usd …
    joint_names: tuple[str, ...]  # as stored; "#11" for the unnamed node 11
    nodes: tuple[int, ...]  # the document's node of every joint
    parents: tuple[int, ...]  # joint index, -1 for roots; parents first
    rest: np.ndarray  # [N, 4, 4] world, as the nodes stand in the file
    bind: np.ndarray  # [N, 4, 4] world, as the joints stood when the skin was bound; rest where nothing is bound
    skinned: np.ndarray  # [N] bool: belongs to a skin
    weighted: np.ndarray  # [N] bool: moves vertices (all, where weights cannot be read)
    declared: dict[str, int]  # humanoid bones that the file names itself (VRM) -> joint
    document: GltfDocument
    notes: tuple[str, ...] = ()  # what was lost or assumed while reading

    @property
    def joint_count(self) -> int:
        """Number of joints N."""
        return len(self.joint_names)

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """Joint indices of the children of every joint."""
        found: list[list[int]] = [[] for _ in self.parents]
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                found[parent].append(joint)
        return tuple(map(tuple, found))

    def ancestors(self, joint: int) -> list[int]:
        """The joint's parent, its parent, … up to a root."""
        chain = []
        while (joint := self.parents[joint]) >= 0:
            chain.append(joint)
        return chain

    def path(self, top: int, joint: int) -> list[int]:
        """Joints below `top` down to `joint`, both ends: [] when `top` is no ancestor."""
        chain = [joint, *self.ancestors(joint)]
        return chain[: chain.index(top) + 1][::-1] if top in chain else []

    def index(self, name: str) -> int:
        """The joint of a stored name or of "#node index"; RigError when there is none or several."""
        found = [i for i, own in enumerate(self.joint_names) if own == name]
        if not found and name.startswith("#") and name[1:].isdigit() and int(name[1:]) in self.nodes:
            found = [self.nodes.index(int(name[1:]))]
        if len(found) != 1:
            listing = ", ".join(self.joint_names[:40])
            reason = f"{len(found)} joints are called {name!r}" if found else f"there is no joint {name!r}"
            remedy = "Name a joint by its number in the file: #12." if found else f"Its joints: {listing}"
            raise RigError(f"{self.name}: {reason}", remedy=remedy)
        return found[0]


def rig_of_document(document: GltfDocument, *, name: str, format: str, notes: tuple[str, ...] = ()) -> Rig:
    """The rig of a glTF document: the joints of its skins with all nodes above and below, or all nodes without a skin.

    Raises RigError when there is nothing that could be a skeleton.
    """
    try:
        parents, worlds = document.node_parents(), document.node_worlds()
        skins = _Skins(document, worlds)
    except (GltfError, KeyError, IndexError, TypeError, ValueError, np.linalg.LinAlgError) as error:
        raise RigError(f"{name} cannot be read: {error}", remedy="Export it again as GLB.") from error
    members = _members(document, parents, skins.joints)
    order = [node for node in parents_first(parents) if node in members]
    if len(order) < 2:
        raise RigError(f"{name} has no joints: it holds {len(parents)} nodes and no skeleton", remedy=_NO_JOINTS)
    place = {node: joint for joint, node in enumerate(order)}
    bind = _bind(order, parents, document, worlds, skins)
    return Rig(
        name=name,
        format=format,
        joint_names=tuple(document.json["nodes"][node].get("name") or f"#{node}" for node in order),
        nodes=tuple(order),
        parents=tuple(place.get(parents[node], -1) for node in order),
        rest=worlds[order],
        bind=bind,
        skinned=np.array([node in skins.joints for node in order]),
        weighted=np.array([node in skins.weighted for node in order]) if skins.weighted else np.ones(len(order), bool),
        declared={bone: place[node] for bone, node in declared_bones(document).items() if node in place},
        document=document,
        notes=notes,
    )


_NO_JOINTS = "Export the character with its armature (a skin, or nodes for the bones)."


class _Skins:
    """What the skins of a document say about their joints."""

    def __init__(self, document: GltfDocument, worlds: np.ndarray) -> None:
        self.joints: dict[int, np.ndarray | None] = {}  # node -> its bind placement in the world
        self.weighted: set[int] = set()
        nodes = document.json.get("nodes", [])
        for index, skin in enumerate(document.json.get("skins", [])):
            carriers = [i for i, node in enumerate(nodes) if node.get("skin") == index]
            placed = _bind_worlds(document, skin, worlds, carriers)
            for node, matrix in zip(skin["joints"], placed, strict=True):
                self.joints.setdefault(node, matrix)
            for carrier in carriers:
                self._weigh(document, skin, nodes[carrier].get("mesh"))

    def _weigh(self, document: GltfDocument, skin: dict[str, Any], mesh: int | None) -> None:
        if mesh is None:
            return
        for primitive in document.json["meshes"][mesh]["primitives"]:
            attributes = primitive["attributes"]
            if "JOINTS_0" not in attributes or "extensions" in primitive:
                self.weighted.update(skin["joints"])
                continue
            try:
                joints, weights = (document.values(attributes[n]) for n in ("JOINTS_0", "WEIGHTS_0"))
            except GltfError:
                self.weighted.update(skin["joints"])
                continue
            self.weighted.update(skin["joints"][slot] for slot in np.unique(joints[weights > 1e-4]))


def _bind_worlds(
    document: GltfDocument, skin: dict[str, Any], worlds: np.ndarray, carriers: list[int]
) -> list[np.ndarray | None]:
    """Where each joint stood in the world when the skin was bound.

    Inverse bind matrices are in the space of the mesh, whatever that was: of the spaces it may have been, the one is
    taken in which the joints lie closest to where the nodes are.
    """
    joints = skin["joints"]
    if "inverseBindMatrices" not in skin:
        return [None] * len(joints)
    inverse = document.values(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)[: len(joints)]
    usable = np.abs(np.linalg.det(inverse)) > 1e-12
    if len(inverse) < len(joints) or not usable.all():
        return [None] * len(joints)
    bound, rest = np.linalg.inv(inverse), worlds[joints]
    spaces = [np.eye(4), *(worlds[c] for c in carriers), *(rest[i] @ inverse[i] for i in range(len(joints)))]
    spread = max(float(np.ptp(rest[:, :3, 3], axis=0).max()), 1e-9)

    def gap(space: np.ndarray) -> float:
        return float(np.median(np.linalg.norm((space @ bound)[:, :3, 3] - rest[:, :3, 3], axis=-1))) / spread

    gaps = [gap(space) for space in spaces]
    # The first ones are what exporters mean; a joint's own space only where those are clearly elsewhere.
    best = next((i for i in range(1 + len(carriers)) if gaps[i] < 0.02), int(np.argmin(gaps)))
    return list(spaces[best] @ bound)


def _members(document: GltfDocument, parents: list[int], skinned: dict[int, Any]) -> set[int]:
    """Nodes that count as joints: those of skins, all above them, and those below that carry no mesh."""
    nodes = document.json.get("nodes", [])
    if not skinned:
        # Cameras, lights and props stand beside the character: the largest tree is it.
        roots = [([i, *_above(parents, i)])[-1] for i in range(len(nodes))]
        largest = max(set(roots), key=roots.count) if roots else -1
        return {i for i, root in enumerate(roots) if root == largest}
    members: set[int] = set()
    for node in skinned:
        at = node
        while at != -1:
            members.add(at)
            at = parents[at]
    members |= set(declared_bones(document).values())
    for node in parents_first(parents):
        if parents[node] in members and not ({"mesh", "camera", "skin"} & nodes[node].keys()):
            members.add(node)
    return members


def _above(parents: list[int], node: int) -> list[int]:
    chain = []
    while (node := parents[node]) != -1:
        chain.append(node)
    return chain


def _bind(
    order: list[int], parents: list[int], document: GltfDocument, worlds: np.ndarray, skins: _Skins
) -> np.ndarray:
    """Bind placements of all joints: unbound ones keep their local place under a bound parent."""
    found: dict[int, np.ndarray] = {}
    for node in order:
        own, parent = skins.joints.get(node), parents[node]
        if own is not None:
            found[node] = own
        elif parent in found and not np.allclose(found[parent], worlds[parent]):
            found[node] = found[parent] @ node_matrix(document.json["nodes"][node])
        else:
            found[node] = worlds[node]
    return np.stack([found[node] for node in order])


def declared_bones(document: GltfDocument) -> dict[str, int]:
    """Humanoid bones that a VRM 0.x or 1.0 file names, of the 22 that are posed -> node."""
    extensions = document.json.get("extensions", {})
    if "VRMC_vrm" in extensions:
        bones = extensions["VRMC_vrm"].get("humanoid", {}).get("humanBones", {})
        found = {bone: item.get("node") for bone, item in bones.items()}
    else:
        listed = extensions.get("VRM", {}).get("humanoid", {}).get("humanBones", [])
        found = {item.get("bone"): item.get("node") for item in listed}
    count = len(document.json.get("nodes", []))
    return {bone: n for bone, n in found.items() if bone in HUMANOID_BONES and isinstance(n, int) and 0 <= n < count}
