"""Where the objects of a batch are worked on: processes of this machine, or a Ray cluster."""

import importlib
import multiprocessing
import os
import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

from roam_client.types.objects import format_of

from roam_command.commands.batch.work import Order, Outcome, make_goal_pose
from roam_command.reports import UsageError

Done = tuple[Path, Outcome]
Work = Callable[[bytes, str, Order], Outcome]

_BROKEN = Outcome(reason="INTERNAL", message="the process that worked on it ended: out of memory, or a crash")


def local(sources: Iterable[Path], order: Order, *, jobs: int, work: Work = make_goal_pose) -> Iterator[Done]:
    """`jobs` processes of this machine, results as they come.

    When a process dies, the objects that were being worked on are done again one at a time: only the one that kills its
    process fails.
    """
    fresh, suspects = deque(sources), deque[Path]()
    while fresh or suspects:
        waiting, width = (suspects, 1) if suspects else (fresh, jobs)
        flying: dict[Future[Outcome], Path] = {}
        with _pool(width) as pool:
            try:
                while waiting or flying:
                    while waiting and len(flying) < width:
                        source = waiting.popleft()
                        data = _read(source)
                        if isinstance(data, Outcome):
                            yield source, data
                        else:
                            flying[pool.submit(work, data, format_of(source), order)] = source
                    for future in wait(flying, return_when=FIRST_COMPLETED).done:
                        outcome = future.result()
                        yield flying.pop(future), outcome
            except BrokenProcessPool:
                if waiting is suspects:
                    yield from ((source, _BROKEN) for source in flying.values())
                else:
                    suspects.extend(flying.values())


def _read(source: Path) -> bytes | Outcome:
    """A file's bytes, or why there are none: one unreadable file does not end a batch."""
    try:
        return source.read_bytes()
    except OSError as error:
        return Outcome(reason="NOT_READ", message=f"cannot read {source}: {error.strerror}")


def _pool(jobs: int) -> ProcessPoolExecutor:
    # Forked processes would share torch's threads; Ctrl-C is for the command, which lets running objects finish.
    return ProcessPoolExecutor(
        jobs, multiprocessing.get_context("spawn"), signal.signal, (signal.SIGINT, signal.SIG_IGN)
    )


def ray_cluster(sources: Iterable[Path], order: Order, *, jobs: int, work: Work = make_goal_pose) -> Iterator[Done]:
    """The cluster that RAY_ADDRESS names, or one that Ray starts on this machine with `jobs` processors.

    Every machine needs the services installed. Files are read here and travel with the tasks.
    """
    ray = _ray(jobs)
    task = ray.remote(work)
    capacity = max(1, int(ray.cluster_resources().get("CPU", jobs)))
    waiting, flying = deque(sources), dict[Any, Path]()
    try:
        while waiting or flying:
            while waiting and len(flying) < 2 * capacity:  # the next ones are on their way while the first ones run
                source = waiting.popleft()
                data = _read(source)
                if isinstance(data, Outcome):
                    yield source, data
                else:
                    flying[task.remote(data, format_of(source), order)] = source
            if not flying:
                break
            for reference in ray.wait(list(flying))[0]:
                try:
                    outcome = ray.get(reference)
                except ray.exceptions.RayError:
                    outcome = _BROKEN
                yield flying.pop(reference), outcome
    finally:
        ray.shutdown()


def _ray(jobs: int) -> Any:
    try:
        ray = importlib.import_module("ray")
    except ModuleNotFoundError as error:
        raise UsageError(
            "--engine ray needs Ray, which is not installed here",
            remedy="pip install 'roam-services[ray]', or take --engine local.",
        ) from error
    own = {} if os.environ.get("RAY_ADDRESS") else {"num_cpus": jobs, "include_dashboard": False}
    ray.init(log_to_driver=False, logging_level="error", **own)
    return ray
