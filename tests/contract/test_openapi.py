"""Schemathesis over the OpenAPI of both services: made-up requests get answers that the document describes."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings
from roam_command.embedded import running_in_thread
from roam_goalpose.app import GoalPoseService
from roam_goalpose.settings import GoalPoseSettings
from roam_goalpose.synthesis import Synthesizer
from roam_motion.animator import Animator
from roam_motion.app import MotionService
from roam_motion.settings import MotionSettings
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)

sys.path += [str(Path(__file__).parents[1] / folder) for folder in ("goalpose", "motion")]

from poser import Poser
from walker import Walker

CHECKS = [not_a_server_error, status_code_conformance, content_type_conformance, response_schema_conformance]


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """A server of both services whose networks are stand-ins."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Synthesizer, "load", classmethod(lambda cls, settings: Poser()))
        patch.setattr(Animator, "load", staticmethod(lambda path: Walker()))
        options = GoalPoseSettings(isolate_uploads=False, max_upload_bytes=1 << 20)
        weights = str(Path(__file__))  # only hashed
        services = [
            GoalPoseService(options),
            MotionService(MotionSettings(motion_weights=weights, max_sessions=8, step_process=False)),
        ]
        with running_in_thread(services, options) as addresses:
            yield addresses.http


@pytest.fixture(scope="module")
def schema(address: str) -> schemathesis.BaseSchema:
    # Frames stream for as long as their session lives; the stream's own tests read them.
    whole = schemathesis.openapi.from_url(f"{address}/openapi.json", timeout=30)
    return whole.exclude(path="/v1/sessions/{session}/frames")


def test_answers_are_as_described(schema: schemathesis.BaseSchema) -> None:
    operations = [found.ok() for found in schema.get_all_operations()]
    assert len(operations) > 12
    for operation in operations:

        @settings(
            max_examples=6, deadline=None, derandomize=True, database=None, suppress_health_check=list(HealthCheck)
        )
        @given(case=operation.as_strategy())
        def ask(case: schemathesis.Case) -> None:
            case.call_and_validate(checks=CHECKS, timeout=30)

        ask()
