"""What documents say of energy terms, actions and furniture is what the tables say."""

import re
from pathlib import Path
from typing import get_args

from roam_goalpose.api.messages import ACTIONS
from roam_goalpose.api.request_schemas import CreateReferencePoseJson, SynthesizeJson
from roam_goalpose.energy.terms import TERMS, table
from roam_goalpose.furniture import TABLE
from roam_goalpose.references.pairs import ACTIONS as NAMES
from roam_goalpose.references.pairs import load_references
from roam_goalpose.synthesis import SynthesizerSettings

ROOT = Path(__file__).parents[3]
REFERENCES = SynthesizerSettings().references


def test_the_table_of_terms_is_printed_from_the_registry():
    (document,) = (ROOT / "docs").rglob("goal-poses.md")
    assert table() in document.read_text(), "run `python -m roam_goalpose.energy.terms` and put its output there"


def test_the_protocol_names_every_term():
    (row,) = re.findall(r"^\| `weights` \|.*$", (ROOT / "proto" / "README.md").read_text(), re.MULTILINE)
    assert ", ".join(TERMS) in row


def test_every_term_is_told_apart():
    for attribute in ("name", "symbol", "equation"):
        values = [getattr(term, attribute) for term in TERMS.values()]
        assert len(set(values)) == len(values)
        assert all(values)


def test_schemas_offer_the_actions_that_there_are():
    offered = get_args(SynthesizeJson.model_fields["action"].annotation)[0]
    assert get_args(offered) == get_args(CreateReferencePoseJson.model_fields["action"].annotation) == NAMES
    assert tuple(ACTIONS) == NAMES


def test_references_are_for_categories_and_actions_that_there_are():
    pairs = load_references(REFERENCES)
    assert {category for pair in pairs.values() for category in pair.categories} <= set(TABLE)
    assert {pair.action for pair in pairs.values()} == set(NAMES)
    listed = re.findall(r"^\| `(\w+)` \| (\w+) \|", (REFERENCES / "README.md").read_text(), re.MULTILINE)
    assert dict(listed) == {pair.id: pair.action for pair in pairs.values()}
