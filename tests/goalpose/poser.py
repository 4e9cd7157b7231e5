"""A stand-in synthesizer for the tests of the service around it: it puts the reference pose on the object's middle."""

import threading
from dataclasses import dataclass, field
from functools import cache

import numpy as np
import trimesh
from roam_character.pose import rest_pose
from roam_character.skeleton import humanoid_skeleton
from roam_goalpose.assessment.diagnostics import PoseWarning
from roam_goalpose.objects import load_shape
from roam_goalpose.references.pairs import ReferencePair
from roam_goalpose.solvers.progress import Cancelled, Progress
from roam_goalpose.synthesis import GoalPoseResult, RankedPose


def box_file(size: float = 0.5) -> bytes:
    """A cube of `size` metres as GLB."""
    data = trimesh.creation.box((size, size, size)).export(file_type="glb")
    assert isinstance(data, bytes)
    return data


@cache
def pair(name: str, action: str) -> ReferencePair:
    return ReferencePair(
        id=name,
        title=f"A pose for {name}",
        action=action,
        categories=(),
        pose=rest_pose(humanoid_skeleton()),
        source=load_shape(box_file(), "glb"),
    )


@dataclass
class Poser:
    """Implements goalpose.application.SynthesizesPoses without a network."""

    runs: list[object] = field(default_factory=list)
    gate: threading.Event | None = None  # when set, every run waits for it, looking for cancellation
    stopped: threading.Event = field(default_factory=threading.Event)
    field_name: str = "sha256:poser"

    def __post_init__(self):
        self.references = {"chair_sit": pair("chair_sit", "sit"), "sofa_lie": pair("sofa_lie", "lie")}

    def synthesize(self, shape, request, *, progress=None, cancelled=None):
        self.runs.append(request)
        chosen = (
            request.pair
            or self.references[request.reference or ("chair_sit" if request.action == "sit" else "sofa_lie")]
        )
        progress(Progress(0, 0, 10, 0.0, None))
        while self.gate is not None and not self.gate.wait(0.005):
            if cancelled():
                self.stopped.set()
                raise Cancelled
        pose = rest_pose(request.skeleton) if request.skeleton else chosen.pose
        pose = pose.moved(np.array(shape.bounds.mean(0), np.float32))
        warnings = (PoseWarning("DEEP_PENETRATION", "It stands in the box.", "Use a real synthesizer."),)
        ranked = [
            RankedPose(
                pose=pose.turned(float(rank)),
                place=(0.0, float(shape.bounds[1, 1]), 0.0),
                reference=chosen.id,
                action=chosen.action,
                energies={"descriptor": 1.0, "total": 1.0 + rank},
                diagnostics={"penetration_depth": 0.25, "hip_seat_distance": 0.125, "contacts_met": 0.5},
                bone_depths={"leftFoot": 0.25},
                warnings=warnings,
            )
            for rank in range(request.count)
        ]
        return GoalPoseResult(
            name=f"goalPoses/sha256:{request.seed:064x}",
            pose=pose,
            energies=ranked[0].energies,
            diagnostics=ranked[0].diagnostics,
            warnings=warnings,
            reference=chosen.id,
            action=chosen.action,
            floor_height=shape.floor_height,
            object=shape.name,
            seconds=0.0,
            candidates=(),
            poses=tuple(ranked),
        )
