"""Weights of the energy terms, in SI units: lengths in metres, angles in radians; the total has no unit."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class EnergyWeights:
    """One weight per term; 0 switches a term off (it is then not computed).

    The paper's terms (section 3.1.3): `descriptor`, `angle_limit`, `floor`, `prior`. The others are beyond the
    paper: its skeleton has no volume, and its section E names penetration and missing contacts as the open problems.
    """

    descriptor: float = 1.0  # E_d, mean L1 over unit descriptors [1]
    angle_limit: float = 0.0  # E_a, mean squared excess [1/rad^2]
    floor: float = 0.0  # E_f, summed squared depth [1/m^2]
    prior: float = 0.0  # E_r, mean squared distance to the reference's canonical pose [1/m^2]
    penetration: float = 0.0  # E_c, mean squared depth of capsules in the object [1/m^2]
    contact: float = 0.0  # E_s, mean robust miss of the reference's contacts [1]
    clearance: float = 0.0  # E_n, mean robust difference in distance to the object [1]
    symmetry: float = 0.0  # E_b, mean robust difference of left and right in distance to the object [1]
    facing: float = 0.0  # E_o, squared difference of the fronts of reference and target [1]
    gravity: float = 0.0  # E_g, squared tilt of pelvis and chest against the reference [1/rad^2]
    self_collision: float = 0.0  # E_x, mean squared depth of capsules in each other [1/m^2]
    constraint: float = 0.0  # E_w, squared misses of what the caller asked for, in units of 5 cm and 0.2 rad [1]

    @property
    def looks_at_clearances(self) -> bool:
        """Whether any term needs the distances of the body's spheres from the object."""
        return bool(self.penetration or self.clearance or self.symmetry)

    @property
    def looks_at_the_body(self) -> bool:
        """Whether any term needs the body's spheres."""
        return self.looks_at_clearances or bool(self.self_collision)


# The published weights (supplement C), turned from mm^2, deg^2 and unit-box^2 into SI: 1e-3 deg^-2 = 3.283 rad^-2 and
# 1e-8 mm^-2 = 1e-2 m^-2. See docs/concepts/method.md, "Energy".
PAPER_RIGID = EnergyWeights()
PAPER_JOINTS = EnergyWeights()
PAPER_FULL = EnergyWeights(angle_limit=3.283, floor=1e-2, prior=1e-2)

# Ours. Orders of magnitude that are worth about 0.1 each: descriptor off by a tenth of a radian; a tenth of the
# contacts missed; five spheres of the body 2.5 cm too deep; the joints 6 cm from the reference's pose; trunk tilted by
# 18 degrees.
DEFAULT = EnergyWeights(
    descriptor=0.7,
    angle_limit=1.0,
    floor=100.0,
    prior=30.0,
    penetration=10000.0,
    contact=1.0,
    clearance=0.7,
    symmetry=1.5,
    facing=0.5,
    gravity=2.0,
    self_collision=50.0,
    constraint=0.3,
)
