"""Who walks sways, turns and nods with the steps; persons differ; whoever stands is left alone."""

import math

import torch
from roam_motion.animation.manner import NAMES
from roam_motion.animation.shown.gait import sway
from roam_motion.animation.state import PHASE, Characters
from standing import random_animator

FRAMES = 60  # of one cycle


def cycle(share=1.0, **deviates):
    """The sway of a standing body over one cycle of the gait's phase."""
    animator = random_animator()
    figure = animator.figure
    rows = torch.from_numpy(animator.start((0.0, 0.0), 0.0, 0).row).expand(FRAMES, -1).clone()
    characters = Characters.of(rows)
    characters.past[:, -1, PHASE.start] = torch.arange(FRAMES) / FRAMES
    characters.manner = torch.zeros(FRAMES, len(NAMES))
    for name, deviate in deviates.items():
        characters.manner[:, NAMES.index(name)] = deviate
    joints = figure.positions(characters.hips, characters.orientations)
    still = torch.zeros(FRAMES)
    return sway(figure, characters, joints, torch.full((FRAMES,), share), (still, still))


def test_hips_go_over_the_foot_that_stands():
    found = cycle()
    left, right = FRAMES * 100 // 360, FRAMES * 280 // 360  # a quarter after the strike of each foot
    assert found.hips[left, 0] > 0.012 > -0.012 > found.hips[right, 0]
    assert found.feet[left, 1, 1] > 0.005 > found.feet[left, 0, 1]  # the right foot swings meanwhile


def test_the_pelvis_turns_with_the_leg_that_is_ahead():
    strike = round(FRAMES * 0.26 / (2 * math.pi))
    assert cycle().pelvis[strike] < -0.03  # the left hip ahead: turned to the right


def test_persons_differ_and_nobody_who_stands_sways():
    assert cycle(hips=1.5).pelvis.abs().max() > 2 * cycle(hips=-0.3).pelvis.abs().max()
    assert cycle(height=-1.5).hips[:, 1].mean() < cycle(height=0.0).hips[:, 1].mean() - 0.005
    nothing = cycle(share=0.0)
    assert all(float(part.abs().max()) == 0 for part in vars(nothing).values())
