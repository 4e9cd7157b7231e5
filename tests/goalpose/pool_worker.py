"""What the pool's processes run in its tests: a synthesizer that does what the seed says."""

import os
import time
from dataclasses import replace
from unittest import mock

from poser import Poser
from roam_goalpose.energy.objective import Objective
from roam_goalpose.solvers.progress import Cancelled, Progress
from roam_goalpose.synthesis import RequestError, Synthesizer

WAIT, DIE, REFUSE, FAIL = 101, 102, 103, 104


class Actor(Poser):
    """A poser with moods."""

    def synthesize(self, shape, request, *, progress=None, cancelled=None):
        if request.seed == WAIT:
            progress(Progress(1, 1, 10, 0.5, None))
            while not cancelled():
                time.sleep(0.001)
            raise Cancelled
        if request.seed == DIE:
            os._exit(7)
        if request.seed == REFUSE:
            raise RequestError("solver", "not this one")
        if request.seed == FAIL:
            raise ZeroDivisionError("deep inside")
        found = super().synthesize(shape, request, progress=progress, cancelled=cancelled)
        return replace(found, seconds=float(os.getpid()))  # who did it


class Counter(Synthesizer):
    """The real one. From the iteration that the seed says it waits until its caller has left; then it refuses with
    the number of iterations that began after that."""

    def synthesize(self, shape, request, *, progress=None, cancelled=None):
        begun = []

        def expand(*arguments, **options):
            begun.append(cancelled())
            return plain(*arguments, **options)

        def tell(told):
            progress(told)
            while told.iteration >= request.seed > 0 and not cancelled():
                time.sleep(0.005)
                progress(told)  # the pool leaves out what comes too often

        plain = Objective.expand
        with mock.patch.object(Objective, "expand", expand):
            try:
                return super().synthesize(shape, request, progress=tell, cancelled=cancelled)
            except Cancelled:
                raise RequestError("iterations", str(sum(begun))) from None


def load_counter(settings):
    return Counter.load(settings)


def load(settings):
    return Actor()


def load_nothing(settings):
    raise FileNotFoundError("no weights here")
