"""Evaluation results survive an interruption."""

import json

from roam_evaluation.shared.ledger import Ledger


def ledger(path, plan=None, **options):
    return Ledger(path, plan or {"headings": 2}, summarise=len, **options)


def test_goes_on_where_it_stopped(tmp_path):
    path = tmp_path / "results" / "study.json"
    first = ledger(path)
    first.add("chair", [{"deep": 0.01}, {"deep": 0.02}])
    again = ledger(path)
    assert list(again.pending(["chair", "sofa"])) == ["sofa"]
    again.add("sofa", [{"deep": 0.03}])
    report = json.loads(path.read_text())
    assert report["summary"] == 3
    assert [record["deep"] for record in again.records] == [0.01, 0.02, 0.03]


def test_begins_anew_with_another_plan(tmp_path):
    path = tmp_path / "study.json"
    ledger(path).add("chair", [{}])
    assert list(ledger(path, {"headings": 3}).pending(["chair"])) == ["chair"]


def test_starts_nothing_when_the_time_is_up():
    assert list(ledger(None, minutes=-1).pending(["chair"])) == []


def test_keeps_nothing_without_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ledger(None).add("chair", [{}])
    assert list(tmp_path.iterdir()) == []
