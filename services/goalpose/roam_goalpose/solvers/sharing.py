"""Requests in several threads that share their Newton steps.

One thread computes at a time: tensor operations of two would only fight for the core. It goes on until it has a problem
that others may have too. When all who take part have come that far, one of them solves all problems of a kind at once.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from threading import Condition

from roam_goalpose.solvers.candidates import Candidates
from roam_goalpose.solvers.gauss_newton import Problem, minimise_together


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
            outcomes = _outcomes(chosen)
        finally:
            self._changed.acquire()
        for post, outcome in zip(chosen, outcomes, strict=True):
            post.outcome = outcome
        self._end()

    def _begin(self) -> None:
        self._changed.wait_for(lambda: not self._computing)
        self._computing = True

    def _end(self) -> None:
        self._computing = False
        self._changed.notify_all()


def _outcomes(posts: Sequence[_Post]) -> Sequence[Candidates | Exception]:
    """What becomes of each; one error of the computation itself is everyone's."""
    try:
        return minimise_together([post.problem for post in posts])
    except Exception as error:
        return [error] * len(posts)
