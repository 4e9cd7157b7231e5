import json

import numpy as np
import pytest
from fake_services import FRAMES_TO_GOAL, Fake
from roam_client import Action, AsyncClient, Client, FormatError, Motion, Placement


def bake(client: Client, **options) -> Motion:
    goal = client.synthesize("objects/sha256:abc")
    with client.create_session(Placement(0, 3), floor_height=goal.floor_height) as session:
        return session.bake(goal, **options)


def test_a_bake_ends_after_the_hold(client: Client, fake: Fake):
    motion = bake(client, hold=0.5)
    assert motion.frame_count == FRAMES_TO_GOAL + 15
    assert motion.action_at(-1) is Action.SIT
    assert motion.duration == pytest.approx(motion.frame_count / 30)
    assert fake.motions.deleted == ["sessions/1"]


def test_a_bake_is_capped(client: Client):
    motion = bake(client, max_frames=7)
    assert motion.frame_count == 7
    assert motion.goal_reached is None


def test_standing_up_again_is_baked_the_same_every_time(client: Client):
    motions = [bake(client, hold=0.2, stand_up=True) for _ in range(2)]
    assert motions[0].action_at(-1) is Action.IDLE
    assert Action.SIT in motions[0].actions
    np.testing.assert_array_equal(motions[0].actions, motions[1].actions)


def test_every_frame_is_reported(client: Client):
    seen = []
    motion = bake(client, on_frame=lambda frame: seen.append(frame.sequence))
    assert seen == list(range(1, motion.frame_count + 1))


def test_a_motion_saves_as_npz_and_json_with_the_promised_names(client: Client, tmp_path):
    motion = bake(client, hold=0.1)
    count = motion.frame_count
    motion.save(tmp_path / "motion.npz")
    with np.load(tmp_path / "motion.npz", allow_pickle=False) as file:
        shapes = {name: file[name].shape for name in file.files}
        assert file["fps"] == 30
        assert file["action_names"][file["action"][-1]] == "sit"
    promised = {
        "joint_names": (3,),
        "parents": (3,),
        "root_position": (count, 3),
        "rotations": (count, 3, 4),
        "joint_positions": (count, 3, 3),
        "contacts": (count, 4),
        "action": (count,),
        "fps": (),
        "goal_joint_positions": (3, 3),
        "object_to_world": (4, 4),
    }
    assert promised.items() <= shapes.items()
    motion.save(tmp_path / "motion.json")
    assert len(json.loads((tmp_path / "motion.json").read_text())["rotations"]) == count
    with pytest.raises(FormatError, match=r"\.npz and \.json"):
        motion.save(tmp_path / "motion.fbx")


def test_a_motion_without_a_goal_has_no_distance(client: Client):
    with client.create_session() as session, session.stream(pacing="credit") as stream:
        frames = [frame for frame, _ in zip(stream.frames(), range(3), strict=False)]
    motion = Motion.from_frames(frames, skeleton=stream.header.skeleton, frame_rate=30)
    assert "goal_joint_positions" not in motion.arrays()
    with pytest.raises(ValueError, match="no goal"):
        motion.goal_distances()


async def test_the_async_twin_bakes_the_same(fake: Fake, client: Client):
    async with AsyncClient(goalpose=fake.address, motion=fake.address) as twin:
        goal = await twin.synthesize("objects/sha256:abc")
        async with await twin.create_session(Placement(0, 3), floor_height=goal.floor_height) as session:
            motion = await session.bake(goal, hold=0.3, stand_up=True)
    same = bake(client, hold=0.3, stand_up=True)
    np.testing.assert_array_equal(motion.joint_positions, same.joint_positions)
