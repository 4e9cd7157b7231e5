"""What the pool's processes run in its tests: a synthesizer that does what the seed says."""

import os
import time
from dataclasses import replace

from goalpose.progress import Cancelled, Progress
from goalpose.synthesis import RequestError
from poser import Poser

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


def load(settings):
    return Actor()


def load_nothing(settings):
    raise FileNotFoundError("no weights here")
