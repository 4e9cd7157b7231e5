"""A further motion model: one module that registers a key, and the service streams what it predicts."""

import json

import httpx
import numpy as np
import pytest
import torch
from roam_motion.animation.blending import Blending
from roam_motion.animation.figure import humanoid_figure
from roam_motion.animation.prediction import Prediction
from roam_motion.animation.state import FUTURE
from roam_motion.app import MotionService
from roam_motion.models import registry
from roam_motion.settings import MotionSettings
from roam_serving.server import running
from safetensors.torch import save_file

KEY = "glide"


class Glide:
    """Whoever shall go somewhere glides there, at a share of the way per frame that its weights say."""

    blending = Blending()

    def __init__(self, figure, share, starts):
        self.figure, self.share, self.starts = figure, share, starts

    def predictor(self):
        return self.predict

    def predict(self, characters, goals, positions, root):
        batch, joints = positions.shape[:2]
        way = root.points_in(goals.positions[:, -1:])[:, 0] * self.share
        step = torch.stack([way[:, 0], torch.zeros_like(way[:, 0]), way[:, 1]], -1)
        axes = torch.cat([root.turn_in(characters.orientations[..., i]) for i in (2, 1)], -1)
        upright = axes.new_tensor([0.0, 0.0, 1.0, 0.0, 1.0, 0.0]).expand(batch, joints, 6)
        place = torch.cat([way, torch.zeros_like(way[:, :1]), torch.ones_like(way[:, :1])], -1)[:, None]
        keys = torch.cat([place, goals.action[:, None]], -1).expand(-1, FUTURE + 1, -1)
        still = place.new_tensor([0.0, 0.0, 0.0, 1.0]).expand(batch, FUTURE + 1, 4)
        return Prediction(
            positions=root.points_in(positions) + step[:, None],
            axes=axes,
            inverse_positions=torch.zeros_like(positions),
            inverse_axes=upright,
            trajectory=keys,
            inverse_trajectory=still,
            contacts=torch.zeros_like(characters.contacts),
            phase=torch.zeros_like(keys[..., 0]),
        )


def load(figure, metadata, tensors):
    return Glide(figure, float(tensors["share"]), {"height": tensors["height"], "orientations": tensors["stance"]})


@pytest.fixture
def weights(tmp_path):
    registry.register(KEY, load)
    figure = humanoid_figure()
    stance = torch.eye(3).expand(1, figure.joint_count, 3, 3).contiguous()
    tensors = {"share": torch.tensor(0.05), "height": torch.tensor([0.95]), "stance": stance}
    save_file(tensors, tmp_path / "glide.safetensors", {"model": KEY, "skeleton": figure.skeleton.id})
    yield tmp_path / "glide.safetensors"
    del registry.MODELS[KEY]


async def test_a_model_of_another_kind_is_streamed_by_the_service(weights):
    settings = MotionSettings(motion_weights=str(weights), step_process=False)
    async with (
        running([MotionService(settings)], settings) as addresses,
        httpx.AsyncClient(base_url=addresses.http, timeout=30) as client,
    ):
        session = (await client.post("/v1/sessions", json={"start": {"x": 1.0}})).json()
        await client.post(f"/v1/sessions/{session['id']}/control", json={"steer": {"velocity": [0.0, 1.0]}})
        answer = await client.get(f"/v1/sessions/{session['id']}/frames", params={"pacing": "burst", "count": 40})
    frames = [line for line in map(json.loads, answer.text.splitlines()) if line["type"] == "frame"]
    way = np.array([frame["root_position"] for frame in frames])
    assert {frame["action"] for frame in frames[5:]} == {"walk"}
    assert way[-1, 2] > 0.5
    np.testing.assert_allclose(way[:, 0], 1.0, atol=0.05)


def test_weights_of_a_model_that_is_not_known_say_which_are(weights, tmp_path):
    other = tmp_path / "other.safetensors"
    save_file({"share": torch.tensor(0.0)}, other, {"model": "other", "skeleton": humanoid_figure().skeleton.id})
    with pytest.raises(ValueError, match="'other'; this build knows l-nsm, glide"):
        registry.load_model(other, humanoid_figure())


def test_a_key_names_one_model(weights):
    with pytest.raises(ValueError, match="glide"):
        registry.register(KEY, load)
