"""What a caller may ask of a goal pose besides that it fits."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from roam.v1 import goal_pose_pb2

from roam_client.types.skeleton import Skeleton

Point = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class PoseWishes:
    """Wishes in world space; they are weighed against the fit, not forced. Whatever is None is free."""

    seat_point: Point | None = None  # that the hips go over [m]
    facing: float | None = None  # heading of the pelvis about +Y [rad]; 0 faces +Z
    left_hand: Point | None = None  # for the middle of the hand [m]
    right_hand: Point | None = None
    weights: Mapping[str, float] = field(default_factory=dict)  # of energy terms; 0 switches one off
    skeleton: Skeleton | None = None  # a person of other proportions; `Skeleton.sized` makes taller and shorter ones

    @property
    def constraints(self) -> goal_pose_pb2.PoseConstraints:
        """The protocol's form of the points and the heading."""
        hands = {goal_pose_pb2.HAND_LEFT: self.left_hand, goal_pose_pb2.HAND_RIGHT: self.right_hand}
        return goal_pose_pb2.PoseConstraints(
            seat_point=self.seat_point or (),
            facing=self.facing,
            hand_targets=[goal_pose_pb2.HandTarget(hand=h, position=p) for h, p in hands.items() if p is not None],
        )
