"""A solver that knows the answer, for the real goal pose service: the browser tests are not about optimising."""

import time
from pathlib import Path

import numpy as np
from roam_goalpose.references.pairs import load_reference
from roam_goalpose.solvers.progress import Progress
from roam_goalpose.synthesis import GoalPoseResult, RankedPose

REFERENCE = Path(__file__).parents[2] / "examples/references/chair_sit.json"


class KnownAnswer:
    """Puts the reference pose, as it is, over the middle of the object, its lowest joint on the floor."""

    field_name = "stub"

    @staticmethod
    def load(settings: object) -> "KnownAnswer":
        return KnownAnswer()

    def __init__(self) -> None:
        self.references = {"chair_sit": load_reference(REFERENCE)}

    def synthesize(self, shape, request, *, progress=None, cancelled=None) -> GoalPoseResult:
        pair = self.references["chair_sit"]
        middle = shape.bounds.mean(0)
        lowest = float(pair.pose.positions()[:, 1].min()) - 0.03
        root = pair.pose.root_position
        pose = pair.pose.moved(np.array([middle[0] - root[0], shape.floor_height - lowest, middle[2] - root[2]]))
        for iteration in range(1, 6):
            step = Progress(1 + iteration // 3, iteration, 5, 1.0 / iteration, pose)
            if progress is not None:
                progress(step)
            time.sleep(0.1)
        ranked = RankedPose(
            pose=pose,
            place=(middle[0], shape.bounds[1, 1], middle[2]),
            reference=pair.id,
            action=request.action,
            energies={"descriptor": 0.2, "total": 0.2},
            diagnostics={"hip_seat_distance": 0.01, "penetration_depth": 0.0, "contacts_met": 1.0},
            bone_depths={},
            warnings=(),
        )
        return GoalPoseResult(
            name=f"goalPoses/sha256:{request.action}",
            pose=ranked.pose,
            energies=ranked.energies,
            diagnostics=ranked.diagnostics,
            warnings=ranked.warnings,
            reference=ranked.reference,
            action=ranked.action,
            floor_height=shape.floor_height,
            object=shape.name,
            seconds=0.5,
            candidates=(),
            poses=(ranked,),
        )
