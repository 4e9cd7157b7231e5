"""A new energy term is one class in the registry: it is weighed, solved, reported and documented without more."""

from pathlib import Path

import numpy as np
import pytest
import torch
from roam_character.skeleton import humanoid_skeleton
from roam_evaluation.goalpose.success import terms_of
from roam_goalpose.energy.reference import PerReference
from roam_goalpose.energy.term import Term, squares
from roam_goalpose.energy.terms import TERMS, table

CHAIR = (Path(__file__).parents[2] / "examples" / "objects" / "chair.glb").read_bytes()


class AnklesApart(Term):
    """(ankle distance - the reference's - 20 cm)^2 [m^2]."""

    name = "ankles_apart"
    symbol = "E_toy"
    equation = "(‖left ankle − right ankle‖ − d_ref − 0.2 m)²"
    weight = 0.0

    def _between(self, figure):
        joints = figure.skeleton.indices(["leftFoot", "rightFoot"])
        return figure.positions[:, joints[0]] - figure.positions[:, joints[1]]

    def prepare(self, reference):
        return PerReference(self._between(reference.figure).norm(dim=-1, keepdim=True))

    def residual(self, scene):
        apart = self._between(scene.figure).norm(dim=-1, keepdim=True)
        return squares(apart - scene.model.prepared[self.name].values - 0.2)

    def jacobian(self, scene):
        joints = torch.tensor(scene.model.skeleton.indices(["leftFoot", "rightFoot"]))
        way = torch.nn.functional.normalize(self._between(scene.figure), dim=-1)[:, None].expand(-1, 2, -1)
        moved = scene.chain.along(joints, scene.figure.positions[:, joints], way)
        return moved[:, :1] - moved[:, 1:]


def ankle_distance(answer: dict) -> float:
    left, right = humanoid_skeleton().indices(["leftFoot", "rightFoot"])
    positions = np.array(answer["joint_positions"])
    return float(np.linalg.norm(positions[left] - positions[right]))


@pytest.fixture
def registered(monkeypatch):
    monkeypatch.setitem(TERMS, AnklesApart.name, AnklesApart())


async def test_a_registered_term_works_from_request_to_answer(registered, goalpose_client, ask):
    async with goalpose_client() as client:
        plain = await ask(client, CHAIR, "glb")
        wide = await ask(client, CHAIR, "glb", weights={"ankles_apart": 50.0})
        documented = (await client.get("/openapi.json")).json()["components"]["schemas"]["SynthesizeJson"]
    assert "ankles_apart" not in plain["energies"]
    assert 0 <= wide["energies"]["ankles_apart"] < 50 * 0.2**2
    assert sum(v for name, v in wide["energies"].items() if name != "total") == pytest.approx(wide["energies"]["total"])
    assert ankle_distance(wide) > ankle_distance(plain) + 0.08
    assert "ankles_apart" in documented["properties"]["weights"]["propertyNames"]["enum"]
    assert AnklesApart.equation in documented["properties"]["weights"]["description"]


async def test_a_term_that_is_not_registered_is_refused_with_the_names_that_are(goalpose_client):
    async with goalpose_client() as client:
        name = (await client.post("/v1/objects", params={"format": "glb"}, content=CHAIR)).json()["name"]
        request = {"object": name, "action": "sit", "weights": {"ankles_apart": 1.0}}
        refused = await client.post("/v1/goal-poses", json=request)
    assert refused.status_code == 400
    assert "descriptor, angle_limit" in refused.json()["detail"]


def test_studies_and_documentation_know_a_registered_term(registered):
    assert terms_of("descriptor,ankles_apart") == ("descriptor", "ankles_apart")
    assert "`ankles_apart`" in table()
