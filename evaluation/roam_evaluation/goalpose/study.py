"""Runs a study over objects: in this process or in several, object by object, into a ledger."""

import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
import torch
from roam_goalpose.objects import ObjectError
from roam_goalpose.synthesis import Synthesizer

from roam_evaluation.goalpose.inputs.objects import EvaluationObject
from roam_evaluation.shared.ledger import Ledger, Record

# What one object is asked: of a synthesizer, under a plan that can be sent to another process.
Work = Callable[[Synthesizer, EvaluationObject, Any], list[Record]]
Load = Callable[[Any], Synthesizer]

_SYNTHESIZER: Synthesizer | None = None


def run_study(
    ledger: Ledger, objects: list[EvaluationObject], work: Work, plan: Any, *, load: Load, jobs: int = 1
) -> None:
    """Every object that the ledger does not have yet; unreadable ones are told and give no records."""
    by_name = {item.name: item for item in objects}
    if jobs == 1:
        _start(load, plan)
        for name in ledger.pending(by_name):
            ledger.add(name, _work((work, by_name[name], plan)))
        return
    with ProcessPoolExecutor(jobs, initializer=_start, initargs=(load, plan)) as pool:
        waiting = list(ledger.pending(by_name))
        for name, records in zip(waiting, pool.map(_work, [(work, by_name[n], plan) for n in waiting]), strict=True):
            ledger.add(name, records)


def _start(load: Load, plan: Any) -> None:
    global _SYNTHESIZER
    np.seterr(all="raise", under="ignore")
    torch.set_num_threads(1)
    _SYNTHESIZER = load(plan)


def _work(item: tuple[Work, EvaluationObject, Any]) -> list[Record]:
    assert _SYNTHESIZER is not None
    work, found, plan = item
    try:
        return work(_SYNTHESIZER, found, plan)
    except ObjectError as error:
        print(f"{found.name}: {error}", file=sys.stderr)
        return []


def shipped(_: Any) -> Synthesizer:
    """The shipped field and references."""
    return Synthesizer.load()
