"""`roam evaluate rigs DIR`: are the bones of foreign characters told right, and do poses arrive on them?

    roam evaluate rigs DIR [--without-names] [--json FILE]

DIR holds characters, for each a hand-made NAME.map.json ({VRM bone: joint name, "#node" or null}) and perhaps a
NAME.alt.json (bone: every answer that also counts). A folder `negative` holds what is no humanoid and must be refused.

For each character the shipped reference poses are carried over to its proportions, put on its joints, written as GLB
and read back from the file: the distance of hips, hands, feet and toes from where the pose has them, the angle between
orientations, and how far the drawn soles of the standing figure are from the floor.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from roam_character.documents.gltf_document import GltfDocument, decompose
from roam_character.formats.glb import scene_document
from roam_character.formats.scene import Scene
from roam_character.pose import Pose, rest_pose
from roam_character.retargeting.onto_rig import onto_rig
from roam_character.retargeting.proportions import Fit, bound_points, fit
from roam_character.rigs.mapping import BoneMap, map_bones
from roam_character.rigs.reading import RIG_READERS, read_rig
from roam_character.rigs.rig import HUMANOID_BONES, Rig, RigError
from roam_character.rotation import quat_angle, quat_inv, quat_mul
from roam_goalpose.references.bodies import fitted
from roam_goalpose.references.pairs import ReferencePair
from roam_goalpose.synthesis import Synthesizer

CONTACTS = ("hips", "leftHand", "rightHand", "leftFoot", "rightFoot", "leftToes", "rightToes")


@dataclass
class Judgement:
    """How one character fared."""

    name: str
    family: str = ""
    confidence: float = 0.0
    mapped: int = 0  # bones of the hand-made map
    right: int = 0
    wrong: list[str] = field(default_factory=list)  # "bone: found instead of true"
    invented: list[str] = field(default_factory=list)  # bones told where there are none
    refused: str = ""
    contact_error: float = 0.0  # [m] largest over contacts and poses
    angle_error: float = 0.0  # [degree] mean over bones and poses
    sole_error: float = 0.0  # [m] lowest drawn point of the standing figure, from the floor
    height: float = 0.0  # [m] as shown


def judge(path: Path, *, without_names: bool) -> Judgement:
    """Maps one character and measures poses on it."""
    truth = json.loads(_beside(path, "map").read_text())
    alternatives = json.loads(_beside(path, "alt").read_text()) if _beside(path, "alt").exists() else {}
    found = Judgement(path.name, mapped=sum(v is not None for v in truth.values()))
    try:
        rig = read_rig(path)
        bones = map_bones(_nameless(rig) if without_names else rig)
    except RigError as error:
        found.refused = f"{error} {error.remedy}"
        return found
    found.family, found.confidence = bones.family, bones.overall
    _compare(found, rig, bones, truth, alternatives)
    measured = fit(rig, bones)
    found.height = measured.height
    found.sole_error = _sole_error(measured)
    gaps, angles = zip(*(_round_trip(measured, pose) for pose in _poses(measured)), strict=True)
    found.contact_error, found.angle_error = float(max(gaps)), float(np.mean(angles))
    return found


def _beside(path: Path, kind: str) -> Path:
    return path.with_name(f"{path.stem}.{kind}.json")


def _nameless(rig: Rig) -> Rig:
    """The same tree and shape without a name or a declaration."""
    return replace(rig, joint_names=tuple(f"#{node}" for node in rig.nodes), declared={})


def _compare(
    found: Judgement, rig: Rig, bones: BoneMap, truth: dict[str, str | None], others: dict[str, list[str | None]]
) -> None:
    for bone in HUMANOID_BONES:
        joint = bones.bones.get(bone)
        told = None if joint is None else rig.joint_names[joint]
        right = told == truth[bone] or told in others.get(bone, [])
        if truth[bone] is not None:
            found.right += right
            if not right:
                found.wrong.append(f"{bone}: {told} instead of {truth[bone]}")
        elif told is not None and not right:
            found.invented.append(f"{bone}: {told}")


def _poses(measured: Fit) -> Iterator[Pose]:
    """The shipped reference poses, as this body would hold them."""
    for pair in _references():
        yield fitted(pair, measured.skeleton).pose


@cache
def _references() -> tuple[ReferencePair, ...]:
    return tuple(Synthesizer.load().references.values())


def _round_trip(measured: Fit, pose: Pose) -> tuple[float, float]:
    """Largest distance of a contact [m] and mean angle of the bones [degree] in the written file."""
    motion = onto_rig(measured, pose)
    document = GltfDocument.read(scene_document(Scene(pose, character=motion)).to_bytes())
    worlds = document.node_worlds()[list(measured.rig.nodes)]  # the file's own nodes come first, with their numbers
    places, turns = worlds[:, :3, 3], decompose(worlds)[1]
    posture = pose.posture()
    gaps, angles = [], []
    for bone, joint in measured.bones.items():
        carrier = measured.carriers[joint]
        own = quat_mul(turns[joint], quat_inv(measured.turns[joint]))
        angles.append(float(np.degrees(quat_angle(own, np.asarray(posture.orientations[carrier], float)))))
        if bone in CONTACTS and bone != "hips":
            want = np.asarray(posture.positions[measured.skeleton.index(bone)])
            gaps.append(float(np.linalg.norm(places[joint] - want)))
    return max(gaps), float(np.mean(angles))


def _sole_error(measured: Fit) -> float:
    """How far below (or above) the floor the lowest point of the standing figure's feet is [m]."""
    motion = onto_rig(measured, rest_pose(measured.skeleton))
    worlds, lows = motion.worlds()[0], []
    for side in ("left", "right"):
        joint = measured.bones[f"{side}Foot"]
        below = {joint, *(j for j in range(measured.rig.joint_count) if joint in measured.rig.ancestors(j))}
        for one in below:
            points = bound_points(measured.rig, {one})
            if len(points):
                local = (points - measured.rig.bind[one][:3, 3]) @ np.linalg.inv(measured.rig.bind[one][:3, :3]).T
                lows.append(float((local @ worlds[one][:3, :3].T + worlds[one][:3, 3])[:, 1].min()))
    return min(lows) if lows else 0.0


def summarise(judged: Sequence[Judgement], negatives: Sequence[Judgement]) -> dict[str, Any]:
    """Figures over all characters."""
    usable = [j for j in judged if not j.refused]
    mapped = sum(j.mapped for j in judged)
    return {
        "characters": len(judged),
        "mapped_bones": mapped,
        "right": sum(j.right for j in judged) / max(mapped, 1),
        "invented": sum(len(j.invented) for j in judged),
        "refused": sum(bool(j.refused) for j in judged),
        "negatives": len(negatives),
        "negatives_refused": sum(bool(j.refused) for j in negatives),
        "largest_contact_error_m": max((j.contact_error for j in usable), default=0.0),
        "mean_angle_error_degrees": float(np.mean([j.angle_error for j in usable])) if usable else 0.0,
        "largest_sole_error_m": max((abs(j.sole_error) for j in usable), default=0.0),
    }


def main(arguments: Sequence[str]) -> int:
    """Prints a line for each character and the figures; 1 when a goal is missed, unless names are left out."""
    parser = argparse.ArgumentParser(prog="roam evaluate rigs", description=__doc__.split("\n", 1)[0])
    parser.add_argument("folder", type=Path, metavar="DIR")
    parser.add_argument("--without-names", action="store_true", help="tell the bones by tree and shape alone")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write everything here")
    options = parser.parse_args(arguments)
    judged, negatives = list[Judgement](), list[Judgement]()
    for path in sorted(options.folder.rglob("*")):
        if path.suffix.lower() in RIG_READERS and _beside(path, "map").exists():
            item = judge(path, without_names=options.without_names)
            (negatives if path.parent.name == "negative" else judged).append(item)
            print(line(item), file=sys.stderr, flush=True)
    if not judged:
        parser.error(f"no character with a map beside it in {options.folder}")
    figures = summarise(judged, negatives)
    if options.json:
        everything = {"figures": figures, "characters": [vars(j) for j in (*judged, *negatives)]}
        options.json.write_text(json.dumps(everything, indent=1) + "\n")
    print(json.dumps(figures, indent=1))
    reached = figures["right"] >= 0.98 and not figures["invented"] and len(negatives) == figures["negatives_refused"]
    return 0 if reached or options.without_names else 1


def line(item: Judgement) -> str:
    """One character for people."""
    if item.refused:
        return f"{item.name:28} refused: {item.refused[:110]}"
    odd = "; ".join([*item.wrong, *(f"invented {bone}" for bone in item.invented)])
    return (
        f"{item.name:28} {item.family[:22]:22} {item.right}/{item.mapped} sure {item.confidence:.2f}  "
        f"contacts {1000 * item.contact_error:.2f} mm, {item.angle_error:.3f}°, "
        f"soles {1000 * item.sole_error:+.1f} mm, {item.height:.2f} m  {odd}"
    )


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
