"""The physics test holds sitters up and lets the others fall."""

import numpy as np
import pytest
from roam_evaluation.goalpose.simulation.solid_boxes import solid_boxes
from seating import sitter

pytest.importorskip("mujoco", reason="needs MuJoCo: pip install 'roam-services[evaluation]'")

import mujoco
from roam_evaluation.goalpose.simulation.world import drift, settled

# A hinge that is driven instead of damped.
EXPLOSIVE = """<mujoco><option timestep="0.004"/><worldbody><body pos="0 0 1"><freejoint/><geom size="0.1" mass="1"/>
<body pos="0.3 0 0"><joint type="hinge" axis="0 1 0" damping="{damping}"/><geom size="0.1" mass="1"/></body></body>
</worldbody></mujoco>"""


def test_a_sitter_stays():
    found = drift(sitter().pose, sitter().shape)
    assert found.largest < 0.1
    assert found.mean <= found.largest


@pytest.mark.parametrize("offset", [[0.0, 0.3, 0.0], [0.0, 0.0, 0.45]], ids=["above the seat", "in front of the chair"])
def test_whoever_nothing_holds_falls(offset):
    found = drift(sitter().pose.moved(np.array(offset, np.float32)), sitter().shape)
    assert found.joints[0] > 0.2


def test_boxes_fill_the_object():
    shape = sitter().shape
    boxes = solid_boxes(shape, np.array([[0.0, 0.45, 0.0]]), reach=2.0)
    random = np.random.default_rng(0)
    points = random.uniform(*shape.bounds, (4000, 3))
    inside = (np.abs(points[:, None] - boxes.centers) <= boxes.half).all(-1).any(-1)
    distance = shape.distance.sample(points)
    clear = np.abs(distance) > 0.01
    assert (inside[clear] == (distance[clear] < 0)).all()
    assert 0 < inside.mean() < 0.5


def test_boxes_do_not_overlap():
    boxes = solid_boxes(sitter().shape, np.array([[0.0, 0.45, 0.0]]), reach=2.0)
    apart = np.abs(boxes.centers[:, None] - boxes.centers) - (boxes.half[:, None] + boxes.half)
    overlapping = (apart < -1e-6).all(-1)
    assert overlapping.sum() == len(boxes.half)  # each with itself


@pytest.mark.parametrize(("damping", "finite"), [(-1e6, False), (0.1, True)], ids=["explodes", "falls"])
def test_a_simulation_that_explodes_counts_as_a_fall(damping, finite):
    """MuJoCo by itself would put it back to its start, from where it falls a millimetre."""
    model = mujoco.MjModel.from_xml_string(EXPLOSIVE.format(damping=damping))
    assert np.isfinite(settled(model, 100)).all() == finite
    assert settled(model, 100).min() > 0.1
