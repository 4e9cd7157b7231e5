import pytest
import torch
from roam_motion.animation.blending import blend_weights, distance_weight, limit_turns
from roam_motion.animation.figure import humanoid_figure


@pytest.mark.parametrize(("distance", "weight"), [(0.0, 0.993), (0.25, 0.5), (0.5, 0.007)])
def test_distance_weights_are_the_published_ones(distance, weight):
    assert float(distance_weight(torch.tensor(distance))) == pytest.approx(weight, abs=5e-4)


def test_weights_rise_slowly_and_need_the_action():
    near, none = torch.zeros(1), torch.zeros(1)
    blend, settled = blend_weights(near, torch.ones(1), none, none, none)
    assert 0 < float(blend) < 0.1
    assert 0 < float(settled) < 0.1
    for _ in range(60):
        blend, settled = blend_weights(near, torch.ones(1), blend, settled, none)
    assert float(blend) == pytest.approx(0.993, abs=1e-3)
    assert float(settled) == 1.0
    assert float(blend_weights(near, torch.zeros(1), none, none, none)[0]) == 0.0


def test_bones_turn_no_faster_than_allowed_and_arrive():
    figure = humanoid_figure()
    now = torch.eye(3).expand(1, 22, 3, 3)
    flipped = torch.diag(torch.tensor([-1.0, 1.0, -1.0])).expand(1, 22, 3, 3)
    turned = limit_turns(figure, now, flipped @ _tilt(0.3), torch.ones(1))
    angle = torch.acos(((now * turned).sum((-1, -2)) - 1) / 2)
    assert float(angle.max()) < 0.3
    small = _tilt(0.05).expand(1, 22, 3, 3)
    torch.testing.assert_close(limit_turns(figure, now, small, torch.ones(1)), small)


def test_in_a_hurry_bones_turn_by_that_much_farther():
    figure = humanoid_figure()
    now, far = torch.eye(3).expand(1, 22, 3, 3), _tilt(0.6).expand(1, 22, 3, 3)
    turned = [limit_turns(figure, now, far, torch.ones(1), hurry) for hurry in (1.0, 1.25)]
    calm, hurried = (torch.atan2(turn[..., 1, 0], turn[..., 0, 0]) for turn in turned)
    torch.testing.assert_close(hurried, 1.25 * calm, atol=0.005, rtol=0)


def _tilt(angle):
    c, s = torch.cos(torch.tensor(angle)), torch.sin(torch.tensor(angle))
    return torch.stack([torch.stack([c, -s, c * 0]), torch.stack([s, c, c * 0]), torch.tensor([0.0, 0.0, 1.0])])
