"""Has runs made: several at once, each kept as soon as it is there, with the time left, until Ctrl-C."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import queue
import threading
from typing import TYPE_CHECKING, Any

from isolux.study import engine
from isolux.study.plan import ordered, weight
from isolux.study.runs import Result, Run

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from isolux.study.plan import Machine
    from isolux.study.size import Level
    from isolux.study.store import Store

__all__ = ["ORDER_NAMES", "Jobs", "State", "Stopped", "count_orders", "make", "order_batches"]

#: Insertion orders that have a name of their own.
ORDER_NAMES = ("as-given", "largest-first", "fewest-cuts")
#: Random orders in a batch: BSP trees are counted in milliseconds, all links in seconds.
_TREES_PER_BATCH, _WORKED_PER_BATCH = 50, 1
#: Seconds between two looks at what the user did.
_LOOK_EVERY = 0.1
_TREES_WEIGHT, _WORKED_WEIGHT = 0.5, 8.0


class Stopped(Exception):  # noqa: N818
    """The user ended the sweep; what was made is kept."""

    def __init__(self, made: int, wanted: int) -> None:
        super().__init__(f"{made:,} of {wanted:,} are made")
        self.made, self.wanted = made, wanted


@dataclasses.dataclass(frozen=True)
class State:
    """How far a sweep is, in the words of `isolux.Progress`."""

    phase: str
    #: Share of the estimated work that is done, in [0, 1].
    done: float
    detail: str
    iteration: int = 0
    residual: float = math.inf
    elements: int = 0
    links: int = 0


@dataclasses.dataclass(frozen=True)
class Job:
    """Something to have made: its weight in seconds, who makes it, who keeps it."""

    name: str
    weight: float
    make: Callable[[Callable[[], bool]], str]
    keep: Callable[[str], None]


class Jobs:
    """Makes jobs on several threads; what keeps them runs on the thread that asked."""

    def __init__(
        self, phase: str, threads: int, show: Callable[[State], None], stopped: Callable[[], bool]
    ) -> None:
        self._phase = phase
        self._threads = threads or os.cpu_count() or 1
        self._show = show
        self._stopped = stopped

    def run(self, jobs: Sequence[Job], made: int) -> None:
        """Make all jobs; `made` are already there.

        Raises
        ------
        Stopped
            Where the user ended it.
        """
        todo: queue.SimpleQueue[Job] = queue.SimpleQueue()
        done: queue.SimpleQueue[tuple[Job, str | BaseException]] = queue.SimpleQueue()
        for job in jobs:
            todo.put(job)
        stop = threading.Event()
        workers = [
            threading.Thread(target=_work, args=(todo, done, stop), daemon=True)
            for _ in range(min(self._threads, len(jobs)))
        ]
        for worker in workers:
            worker.start()
        total = sum(job.weight for job in jobs) or 1.0
        finished, count = 0.0, 0
        try:
            while count < len(jobs):
                self._show(State(self._phase, finished / total, f"{made + count:,} of {made + len(jobs):,}"))
                if self._stopped():
                    break
                try:
                    job, answer = done.get(timeout=_LOOK_EVERY)
                except queue.Empty:
                    continue
                if isinstance(answer, BaseException):
                    raise answer
                job.keep(answer)
                finished += job.weight
                count += 1
        finally:
            # No thread may be left in the extension when the process ends.
            stop.set()
            for worker in workers:
                worker.join()
            count += _keep_what_is_left(done)
        if count < len(jobs):
            raise Stopped(made + count, made + len(jobs))


def _work(
    todo: queue.SimpleQueue[Job],
    done: queue.SimpleQueue[tuple[Job, str | BaseException]],
    stop: threading.Event,
) -> None:
    while not stop.is_set():
        try:
            job = todo.get_nowait()
        except queue.Empty:
            return
        try:
            answer: str | BaseException = job.make(stop.is_set)
        except BaseException as error:  # it is raised again where it is heard
            if stop.is_set():
                return
            answer = error
        done.put((job, answer))


def _keep_what_is_left(done: queue.SimpleQueue[tuple[Job, str | BaseException]]) -> int:
    """Keep what was ready, but not looked at, when a sweep ended; return how many."""
    kept = 0
    while not done.empty():
        job, answer = done.get()
        if isinstance(answer, str):
            job.keep(answer)
            kept += 1
    return kept


def make(
    runs: Sequence[Run],
    store: Store,
    *,
    problem: Callable[[str, Callable[[], bool]], engine.Problem],
    machines: Mapping[str, Machine],
    jobs: Jobs,
) -> tuple[dict[Run, Result], int]:
    """Have all runs made that the store has not got.

    Parameters
    ----------
    runs
        The plan.
    store
        Where results are kept.
    problem
        Gives the problem of a size, see `size.SIZES`; asks now and then whether to stop.
    machines
        By name.
    jobs
        Who makes them.

    Returns
    -------
    tuple
        The result of every run of the plan, without its trace, and how many were made now.
    """
    results: dict[Run, Result] = {}
    for run in runs:
        found = store.get(run)
        if found is not None:
            results[run] = _without_trace(found)
    problems = _Problems(problem)

    def job(run: Run) -> Job:
        machine = machines[run.machine]

        def simulate(stop: Callable[[], bool]) -> str:
            return problems.get(run.size, stop).simulate(run.request(machine.source), stop)

        def keep(answer: str) -> None:
            results[run] = _without_trace(store.keep(run, answer))

        return Job(str(run), weight(run, machine), simulate, keep)

    missing = [run for run in runs if run not in results]
    jobs.run([job(run) for run in ordered(missing, dict(machines))], len(results))
    return {run: results[run] for run in runs}, len(missing)


def _without_trace(result: Result) -> Result:
    """Traces are large: they are read again where they are drawn."""
    return dataclasses.replace(result, trace=[])


class _Problems:
    """Problems by size, each made once, when it is first needed."""

    def __init__(self, make: Callable[[str, Callable[[], bool]], engine.Problem]) -> None:
        self._make = make
        self._made: dict[str, engine.Problem] = {}
        self._lock = threading.Lock()

    def get(self, size: str, stop: Callable[[], bool]) -> engine.Problem:
        with self._lock:
            if size not in self._made:
                self._made[size] = self._make(size, stop)
            return self._made[size]


@dataclasses.dataclass(frozen=True)
class Batch:
    """Insertion orders that are counted in one go."""

    name: str
    names: tuple[str, ...]
    seeds: tuple[int, ...]
    #: Whether all links are counted, not the BSP tree alone.
    worked: bool
    #: Roots of the quadtrees, where links are counted.
    roots: str = "fragments"

    @property
    def weight(self) -> float:
        """Seconds that it may take."""
        return _WORKED_WEIGHT if self.worked else _TREES_WEIGHT


def order_batches(orders: int, worked: int) -> list[Batch]:
    """Insertion orders in batches, each of which is kept: named ones, and random ones by seed from 1 on."""
    batches = [Batch("orders_named", ORDER_NAMES, (), worked=False)]
    for first in range(1, orders + 1, _TREES_PER_BATCH):
        seeds = tuple(range(first, min(first + _TREES_PER_BATCH, orders + 1)))
        batches.append(Batch(f"orders_{seeds[0]}-{seeds[-1]}", (), seeds, worked=False))
    for roots in ("polygons", "fragments") if worked else ():
        batches += [
            Batch(f"orders_worked_{roots}_{name}", (name,), (), worked=True, roots=roots)
            for name in ORDER_NAMES
        ]
        batches += [
            Batch(f"orders_worked_{roots}_{seed}", (), (seed,), worked=True, roots=roots)
            for seed in range(1, worked + 1, _WORKED_PER_BATCH)
        ]
    return batches


def count_orders(
    batches: Sequence[Batch],
    store: Store,
    *,
    scene: Any,  # noqa: ANN401
    level: Level,
    jobs: Jobs,
) -> list[dict[str, Any]]:
    """Have all batches counted that the store has not got.

    Returns
    -------
    list
        One entry per order: ``order``, ``seed``, ``fragments``, ``nodes``, ``root_links``, and where all
        links were counted ``work`` (the machine's units), ``links`` and ``roots``.
    """
    entries: dict[str, list[dict[str, Any]]] = {}
    for batch in batches:
        found = store.get_orders(batch.name)
        if found is not None:
            entries[batch.name] = found

    def job(batch: Batch) -> Job:
        coarse = {**level.coarse.to_dict(), "roots": batch.roots} if batch.worked else None

        def count(stop: Callable[[], bool]) -> str:
            return json.dumps(engine.orders(scene, list(batch.names), list(batch.seeds), coarse, stop))

        def keep(answer: str) -> None:
            counted = [
                {**entry, "roots": batch.roots if batch.worked else None} for entry in json.loads(answer)
            ]
            store.keep_orders(batch.name, counted)
            entries[batch.name] = counted

        return Job(batch.name, batch.weight, count, keep)

    jobs.run([job(batch) for batch in batches if batch.name not in entries], len(entries))
    return [entry for batch in batches for entry in entries[batch.name]]
