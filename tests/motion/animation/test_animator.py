from pathlib import Path

import numpy as np
import pytest
from roam_motion.animation.rows import split_array
from roam_motion.animation.state import shapes_of
from roam_motion.animator import Animator, CharacterState, Goal, Idle, Steer
from standing import played, random_animator, seated_pose

WEIGHTS = Path(__file__).parents[3] / "weights" / "motion.safetensors"
INTENTS = [
    Idle(),
    Steer(np.array([0.5, 0.5])),
    Goal(seated_pose(ahead=1.5)),
    Steer(np.array([0.0, -0.4]), np.array([0.0, 1.0])),
]


def test_a_batch_gives_the_same_bits_as_single_characters():
    animator = random_animator()
    states = [animator.start((i, -i), 0.3 * i, i) for i in range(123)]
    intents = [INTENTS[i % 4] for i in range(123)]
    together, shown = played(animator, states, intents)
    for i in (0, 63, 64, 95, 96, 111, 112, 122):  # of every size that the network is asked with, the padded one too
        alone, single = played(animator, states[i : i + 1], intents[i : i + 1])
        assert alone[0].to_bytes() == together[i].to_bytes()
        np.testing.assert_array_equal(single[-1][0].rotations, shown[-1][i].rotations)


def test_states_survive_serialisation_exactly():
    animator = random_animator()
    states, _ = played(animator, [animator.start((0, 0), 0.0, 1)], [Goal(seated_pose(ahead=0.3))], frames=20)
    again = CharacterState.from_bytes(states[0].to_bytes())
    assert again.to_bytes() == states[0].to_bytes()
    a, _ = played(animator, states, [Idle()])
    b, _ = played(animator, [again], [Idle()])
    assert a[0].to_bytes() == b[0].to_bytes()
    for data in (b"nonsense", b"", states[0].to_bytes()[:-4], states[0].to_bytes() + b"\0" * 8):
        with pytest.raises(ValueError, match="character state"):
            CharacterState.from_bytes(data)


def test_the_same_seed_gives_the_same_motion_and_another_seed_another():
    animator = random_animator()
    runs = [played(animator, [animator.start((0, 0), 0.0, seed)], [INTENTS[1]])[0][0].to_bytes() for seed in (4, 4, 5)]
    assert runs[0] == runs[1] != runs[2]


def test_bones_keep_their_lengths():
    animator = random_animator()
    _, shown = played(animator, [animator.start((0, 0), 1.0, 0)], [INTENTS[2]], frames=30)
    skeleton = animator.figure.skeleton
    for row in shown[::7]:
        bones = row[0].positions[1:] - row[0].positions[list(skeleton.parents[1:])]
        np.testing.assert_allclose(
            np.linalg.norm(bones, axis=-1), np.linalg.norm(skeleton.rest_offsets[1:], axis=-1), atol=1e-4
        )


@pytest.mark.skipif(not WEIGHTS.exists(), reason="weights/motion.safetensors is not there: train or fetch it")
def test_shipped_weights_walk_up_and_sit_down_and_rise():
    animator = Animator.load(WEIGHTS)
    goal = Goal(seated_pose())
    states, shown = played(animator, [animator.start((0.3, 1.4), 3.3, 0)], [goal], frames=170)
    distance = [row[0].goal_distance for row in shown]
    assert min(d for d in distance if d is not None) < 0.05
    way = np.stack([row[0].positions for row in shown])
    assert np.linalg.norm(np.diff(way, axis=0), axis=-1).max() < 0.15
    assert way[..., 1].min() > 0.0
    _, after = played(animator, states, [Idle()], frames=110)
    assert after[-1][0].root_position[1] > 0.8


def test_a_character_stays_who_it_is_and_looks_where_it_is_told():
    animator = random_animator()
    first = animator.start((0, 0), 0.0, 5)
    states, _ = played(animator, [first], [Idle(look_at=np.array([3.0, 1.5, 1.0]))], frames=20)
    manner, gaze = (
        [split_array(s.row[None], shapes_of(len(s.row)))[name][0] for s in (first, states[0])]
        for name in ("manner", "gaze")
    )
    np.testing.assert_array_equal(manner[0], manner[1])
    assert manner[0].any()
    assert not gaze[0].any()
    assert 0.4 < gaze[1][0] < 1.2  # to its left
    again = CharacterState.from_bytes(states[0].to_bytes())
    np.testing.assert_array_equal(again.row, states[0].row)
