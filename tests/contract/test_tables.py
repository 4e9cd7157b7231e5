"""Closed sets that stand in several languages: every copy says what the services' one table says."""

import re
from pathlib import Path

import pytest
from roam.v1 import skeleton_pb2
from roam_client.types.actions import Action
from roam_command.options.shared import ActionName
from roam_motion.actions import ACTIONS, CARRIED, STYLES
from roam_motion.animation.figure import CONTACT_JOINTS
from roam_motion.control.actions import GOAL_ACTIONS

ROOT = Path(__file__).parents[2]
CLIENTS = ROOT / "clients" / "python"
TABLE = {name.upper(): action.number for name, action in ACTIONS.items()}


def page_actions():
    text = (CLIENTS / "roam_command" / "viewer" / "messages.js").read_text()
    found = re.search(r"Action = \{(.*?)\}", text)
    assert found is not None
    pairs = (pair.split(":") for pair in found[1].split(","))
    return {name.strip(): int(number) for name, number in pairs}


@pytest.mark.parametrize(
    "copy",
    [
        {name.removeprefix("ACTION_"): number for name, number in skeleton_pb2.Action.items()},
        {action.name: action.value for action in Action},
        page_actions(),
    ],
    ids=["protocol", "client", "page"],
)
def test_every_list_of_actions_is_the_table(copy):
    assert copy == {"UNSPECIFIED": 0, **TABLE}


def test_the_command_offers_what_takes_a_goal_pose():
    assert {name.value for name in ActionName} == set(GOAL_ACTIONS)


def test_every_action_has_a_style():
    assert {action.style for action in ACTIONS.values()} == set(STYLES)
    assert set(CARRIED) < set(STYLES)


@pytest.mark.parametrize(
    "text", ["roam_client/types/frames.py", "roam_client/types/motions.py", "roam_command/viewer/panel.js"]
)
def test_contacts_are_told_in_the_tables_order(text):
    found = re.findall(r"left\w+, left\w+, right\w+, right\w+", (CLIENTS / text).read_text())
    assert found
    assert set(found) == {", ".join(CONTACT_JOINTS)}
