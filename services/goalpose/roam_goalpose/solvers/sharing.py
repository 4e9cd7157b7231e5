"""Requests in several threads that share their Newton steps.

One thread computes at a time: tensor operations of two would only fight for the core. It goes on until it has a problem
that others may have too. When all who take part have come that far, one of them solves all problems of a kind at once.

What a request gets must not depend on its company, to the bit. Matrix products of other shapes may run through other
kernels, which round otherwise: on one processor never, on another often (seen with MKL on AVX2 and on AMD EPYC, not on
Intel's AVX-512). So company is tried before it is trusted: problems of shapes that have not met yet are solved alone
and together, and only where all bits agree do such problems share steps from then on.
"""

from collections.abc import Hashable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass, replace
from threading import Condition
from typing import Any

from roam_serving.monitoring.logs import get_log
from torch import Tensor

from roam_goalpose.solvers.candidates import Candidates
from roam_goalpose.solvers.gauss_newton import Problem, minimise_together

log = get_log("roam_goalpose.solvers.sharing")


class _Post:
    """A problem that waits for company."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.outcome: Candidates | Exception | None = None


class SharedSteps:
    """`minimise` for threads that take part."""

    def __init__(self) -> None:
        self._changed = Condition()
        self._taking_part = 0
        self._computing = False
        self._posts: list[_Post] = []
        self._agreed: dict[tuple[Hashable, int], bool] = {}  # by shape and size of a company

    @contextmanager
    def taking_part(self) -> Iterator[None]:
        """For a request's computation: in its turn."""
        with self._changed:
            self._taking_part += 1
            self._begin()
        try:
            yield
        finally:
            with self._changed:
                self._taking_part -= 1
                self._end()

    def minimise(self, problem: Problem) -> Candidates:
        """`newton.minimise`, together with those of other threads; only while taking part."""
        mine = _Post(problem)
        with self._changed:
            self._posts.append(mine)
            self._end()
            while mine.outcome is None:
                self._changed.wait_for(lambda: mine.outcome is not None or self._all_wait)
                if mine.outcome is None:
                    self._solve_some()
            self._begin()
        if isinstance(mine.outcome, Exception):
            raise mine.outcome
        return mine.outcome

    @property
    def _all_wait(self) -> bool:
        return not self._computing and len(self._posts) == self._taking_part

    def _solve_some(self) -> None:
        """Solves the shortest problem and its like, for the long ones profit most from company that may still come;
        gives up the lock meanwhile."""
        kind = min(self._posts, key=lambda post: post.problem.iterations).problem.kind
        chosen = [post for post in self._posts if post.problem.kind == kind]
        self._posts = [post for post in self._posts if post not in chosen]
        self._computing = True
        self._changed.release()
        try:
            outcomes = self._outcomes([post.problem for post in chosen])
        finally:
            self._changed.acquire()
        for post, outcome in zip(chosen, outcomes, strict=True):
            post.outcome = outcome
        self._end()

    def _outcomes(self, problems: Sequence[Problem]) -> Sequence[Candidates | Exception]:
        """What becomes of each; one error of the computation itself is everyone's."""
        try:
            if len(problems) == 1 or self._trusted(problems):
                return minimise_together(problems)
            return [outcome for problem in problems for outcome in minimise_together([problem])]
        except Exception as error:
            return [error] * len(problems)

    def _trusted(self, problems: Sequence[Problem]) -> bool:
        """Whether such problems get the same bits in company: tried once for every size of it, as some end sooner."""
        return all(self._agree(problems[:count]) for count in range(2, len(problems) + 1))

    def _agree(self, problems: Sequence[Problem]) -> bool:
        company = problems[0].shape, len(problems)
        if company not in self._agreed:
            quiet = [replace(problem, watch=lambda iteration, found: None) for problem in problems]
            alone = [outcome for problem in quiet for outcome in minimise_together([problem])]
            self._agreed[company] = _same(alone, minimise_together(quiet))
            log.info("company tried", problems=len(problems), same_bits=self._agreed[company])
        return self._agreed[company]

    def _begin(self) -> None:
        self._changed.wait_for(lambda: not self._computing)
        self._computing = True

    def _end(self) -> None:
        self._computing = False
        self._changed.notify_all()


def _same(one: Any, other: Any) -> bool:
    """Whether two values are equal in all the tensors that they hold, to the bit."""
    if isinstance(one, Tensor):
        return one.shape == other.shape and one.numpy().tobytes() == other.numpy().tobytes()
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(_same(one[name], other[name]) for name in one)
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    if is_dataclass(one):
        return all(_same(getattr(one, field.name), getattr(other, field.name)) for field in fields(one))
    return True  # names, skeletons
