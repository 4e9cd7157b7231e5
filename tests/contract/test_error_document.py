"""docs/reference/errors.md and the clients' exceptions follow the table."""

import re

import pytest
from error_document import PATH, SECTIONS, document
from roam_goalpose.objects.errors import REASONS
from roam_serving.errors import by_reason

KINDS = by_reason(kind for _, kinds in SECTIONS for kind in kinds)


def test_the_document_is_up_to_date():
    assert PATH.read_text() == document(), "run: python tests/contract/error_document.py"


def test_what_the_file_reader_refuses_is_in_the_table():
    assert set(REASONS) <= set(KINDS)


@pytest.mark.parametrize("kind", KINDS.values(), ids=lambda kind: kind.reason)
def test_a_row_is_fit_to_be_read(kind):
    assert re.fullmatch(r"[A-Z][A-Z0-9]*(_[A-Z0-9]+)*", kind.reason)
    assert 400 <= kind.http_status <= 599
    assert kind.title[0].isupper()
    assert not kind.title.endswith(".")
    assert kind.remedy.endswith(".")
