"""The ways of lying down: when hips, trunk, legs and hands do their parts of it.

All numbers are shares of a plan of even samples, which is timed afterwards, unless another unit is given. They were
tuned on films and on the measures of lying of `roam evaluate motion --people`: captured people put a
hand down (7 to 11 cm under the hips), bring up one foot after the other, never both over the hips, and recline in 0.8
to 2.4 s.
"""

from dataclasses import dataclass

from torch import Tensor

from roam_motion.animation.collision import Furniture

Span = tuple[float, float]  # shares between which something happens


@dataclass(frozen=True, eq=False)
class Bed:
    """Where one lies and sits, in the world."""

    hips: Tensor  # [2, 3] seated, lying [m]
    aside: Tensor  # [3] horizontal, out of the furniture
    along: Tensor  # [3] horizontal, from head to feet
    sense: float  # 1 when turning from `aside` to `along` is a turn to the left, else -1
    edge: float  # [m] of the furniture, aside of the lying hips
    furniture: Furniture | None


@dataclass(frozen=True)
class Way:
    """One way of lying down."""

    name: str
    scoots: Span  # the hips, from the edge to where they lie
    turns: Span  # from facing out to lying along
    leans: Span  # the trunk, so that a hand carries it
    back: float  # [rad] pitch of the hips then
    sideways: float  # [rad] roll of the hips towards the head end then, as long as they have not turned
    reclines: Span
    legs: tuple[Span, Span]  # first and second foot, from the floor onto the furniture
    stretches: Span  # the first leg; the second a little later
    near: tuple[Span, Span]  # the hand at the head end goes down, and leaves its place again
    far: tuple[Span, Span] | None = None  # the other one


WAYS = (
    Way(
        "leaning back on a hand",
        scoots=(0.20, 0.72),
        turns=(0.10, 0.70),
        leans=(0.0, 0.30),
        back=-0.55,
        sideways=0.22,
        reclines=(0.40, 1.0),
        legs=((0.06, 0.40), (0.30, 0.64)),
        stretches=(0.60, 0.96),
        near=((0.04, 0.24), (0.72, 0.95)),
    ),
    Way(
        "over one side",
        scoots=(0.15, 0.70),
        turns=(0.36, 0.92),
        leans=(0.0, 0.42),
        back=-0.20,
        sideways=0.80,
        reclines=(0.38, 1.0),
        legs=((0.16, 0.50), (0.30, 0.66)),
        stretches=(0.58, 0.96),
        near=((0.02, 0.20), (0.60, 0.90)),
    ),
    Way(
        "by way of sitting lengthwise",
        scoots=(0.16, 0.62),
        turns=(0.06, 0.60),
        leans=(0.0, 0.30),
        back=-0.42,
        sideways=0.15,
        reclines=(0.56, 1.0),
        legs=((0.05, 0.36), (0.26, 0.58)),
        stretches=(0.46, 0.84),
        near=((0.05, 0.26), (0.80, 0.98)),
        far=((0.40, 0.56), (0.82, 0.98)),
    ),
)


def eased(share: Tensor, span: Span) -> Tensor:
    """0 before a span, 1 after it, smooth between. [...] -> [...]."""
    t = ((share - span[0]) / (span[1] - span[0])).clamp(0.0, 1.0)
    return t * t * t * (t * (6 * t - 15) + 10)
