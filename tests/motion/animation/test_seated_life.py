"""The table of what captured people do while they sit plays smoothly and begins anew at its end."""

import torch
from roam_motion.animation.shown.seated_life import BONES, RATE, fidget


def test_the_table_plays_smoothly_also_over_its_end():
    clock = torch.arange(0.0, 400.0, 1 / 30)  # longer than the table
    played = fidget(clock)
    assert played.turns.shape == (len(clock), len(BONES), 3)
    assert 0.02 < played.turns.abs().max() < 0.2
    assert 0.002 < played.hips.norm(dim=-1).max() < 0.008
    assert 0.02 < played.wrists.norm(dim=-1).max() < 0.08
    assert played.wrists.diff(dim=0).norm(dim=-1).max() < 0.03


def test_it_depends_on_the_clock_alone():
    together = fidget(torch.tensor([3.3, 70.1, 3.3]))
    assert torch.equal(together.turns[0], together.turns[2])
    assert torch.equal(fidget(torch.tensor([70.1])).wrists[0], together.wrists[1])
    assert not torch.equal(together.turns[0], fidget(torch.tensor([3.3 + 1 / RATE])).turns[0])
