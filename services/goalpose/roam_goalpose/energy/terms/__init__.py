"""The terms of the energy: a new one is a file here and a line in `TERMS`."""

from roam_goalpose.energy.term import Term
from roam_goalpose.energy.terms.angle_limit import AngleLimit
from roam_goalpose.energy.terms.clearance import Clearance
from roam_goalpose.energy.terms.constraint import Constraint
from roam_goalpose.energy.terms.contact import Contact
from roam_goalpose.energy.terms.descriptor import Descriptor
from roam_goalpose.energy.terms.facing import Facing
from roam_goalpose.energy.terms.feet_ahead import FeetAhead
from roam_goalpose.energy.terms.floor import Floor
from roam_goalpose.energy.terms.gravity import Gravity
from roam_goalpose.energy.terms.penetration import Penetration
from roam_goalpose.energy.terms.prior import Prior
from roam_goalpose.energy.terms.self_collision import SelfCollision
from roam_goalpose.energy.terms.symmetry import Symmetry
from roam_goalpose.energy.terms.unsupported_lean import UnsupportedLean
from roam_goalpose.energy.weights import EnergyWeights

TERMS: dict[str, Term] = {
    term.name: term
    for term in (
        Descriptor(),
        AngleLimit(),
        Floor(),
        Prior(),
        Facing(),
        Gravity(),
        Constraint(),
        Contact(),
        Penetration(),
        Clearance(),
        Symmetry(),
        SelfCollision(),
        FeetAhead(),
        UnsupportedLean(),
    )
}
"""Every term by name, in the order in which they are added up."""


def default_weights() -> EnergyWeights:
    """Every term's own weight."""
    return EnergyWeights.of({term.name: term.weight for term in TERMS.values()})


def published_weights() -> EnergyWeights:
    """The paper's terms with its weights in the last stage (supplement C), turned from mm^2, deg^2 and unit-box^2 into
    SI units; its first stages have the descriptor alone."""
    return EnergyWeights.of({term.name: term.published or 0.0 for term in TERMS.values()})


def table() -> str:
    """The terms as rows of Markdown, for the documentation."""
    head = "| term | name | equation | weight | from |\n| --- | --- | --- | --- | --- |\n"
    rows = [
        f"| {term.symbol} | `{term.name}` | {term.equation} | {term.weight:g} | "
        f"{'ours' if term.published is None else 'paper'} |"
        for term in TERMS.values()
    ]
    return head + "\n".join(rows) + "\n"
