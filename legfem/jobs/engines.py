"""Where many long tasks run: processes, MPI's ranks, or a cluster's workers; one that dies costs itself alone.

Every engine is a `concurrent.futures.Executor`; nothing here deals out tasks beyond handing over the next one.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

from legfem.common.errors import Argument, InputError, Remedy
from legfem.common.input_files import read_toml
from legfem.jobs.pool import Processes, how_ended, interruptible

type EngineName = Literal["local", "mpi", "dask"]
_PATIENCE = "20s"
"""With a scheduler that doesn't answer."""


@dataclass(frozen=True)
class Died:
    """A task whose process, rank or worker ended, twice."""

    problem: str


@dataclass(frozen=True)
class Engine:
    """What runs tasks.

    Parameters
    ----------
    workers : int
        How many tasks it does at once.
    start : callable
        Gives an executor; again after one broke.
    lost : tuple of type
        What a task raises whose worker died, also where the engine tried it on others or it only waited there.
    place : str
        Where it runs and what shows its progress, in words.
    """

    workers: int
    start: Callable[[], AbstractContextManager[Executor]]
    lost: tuple[type[BaseException], ...] = ()
    place: str = ""


def engine_named(name: EngineName, jobs: int, scheduler: str | None) -> AbstractContextManager[Engine | None]:
    """Return what yields an engine; None on MPI's other ranks, after they have served the first.

    Parameters
    ----------
    name
        ``local``, ``mpi`` or ``dask``.
    jobs
        Processes of ``local``.
    scheduler
        Address of a dask scheduler, or its file; or a TOML with the table of a queue (``[slurm]``), whose keys but
        ``jobs`` are those of dask-jobqueue.

    Raises
    ------
    InputError
        If the engine isn't there.
    """
    if scheduler is not None and name != "dask":
        raise InputError(
            Argument("scheduler"), scheduler, f"has no effect on {name}", Remedy("add ", Argument("on", "dask"))
        )
    if name == "local":
        return nullcontext(Engine(jobs, _Here if jobs == 1 else lambda: Processes(jobs)))
    return _ranks() if name == "mpi" else _dask(scheduler)


class _Here(Executor):
    """Does what it is given at once."""

    def submit[**Given, Outcome](
        self, work: Callable[Given, Outcome], /, *given: Given.args, **named: Given.kwargs
    ) -> Future[Outcome]:
        future: Future[Outcome] = Future()
        with interruptible():
            future.set_result(work(*given, **named))
        return future


@contextmanager
def _ranks() -> Iterator[Engine | None]:
    """The ranks of mpirun but the first, which hands over; a rank that dies ends all, as MPI has it."""
    import petsc4py.PETSc  # noqa: F401  (it starts on all ranks together)
    from mpi4py import MPI
    from mpi4py.futures import MPICommExecutor

    ranks = MPI.COMM_WORLD.size
    if ranks == 1:
        raise InputError(Argument("on"), "mpi", "there is one rank", "begin the command with mpirun -n 4")
    with MPICommExecutor(MPI.COMM_WORLD, root=0) as executor:
        if executor is None:
            yield None
            return
        root: Any = executor
        yield Engine(ranks - 1, lambda: nullcontext(root), place=f", on {ranks - 1} ranks")


@contextmanager
def _dask(scheduler: str | None) -> Iterator[Engine]:
    from distributed import Client
    from distributed.scheduler import KilledWorker

    if scheduler is None:
        remedy = "start one with: dask scheduler, workers with: dask worker ADDRESS --nthreads 1, and give its address"
        raise InputError(Argument("scheduler"), "missing", "dask needs a scheduler", remedy)
    with ExitStack() as stack:
        expected, address = 0, {"scheduler_file" if scheduler.endswith(".json") else "address": scheduler}
        if scheduler.endswith(".toml"):
            cluster, expected = _queued(Path(scheduler), stack)
            address = {"address": cluster}
        refused = partial(InputError, Argument("scheduler"), scheduler)
        try:
            client = stack.enter_context(Client(**address, timeout=_PATIENCE))
        except (OSError, ValueError) as error:
            said = " ".join(str(error).split())[:120]
            raise refused(f"doesn't answer ({said})", "check the address") from None
        threads = client.nthreads()
        if not expected and (not threads or max(threads.values()) > 1):
            problem = "has workers of several threads, in which PETSc can't run" if threads else "has no workers"
            raise refused(problem, "start workers with dask worker ADDRESS --nthreads 1")
        workers = expected or len(threads)
        place = f", on {workers} workers{' when their jobs begin' * bool(expected)}, shown at {client.dashboard_link}"
        yield Engine(workers, lambda: client.get_executor(pure=False), (KilledWorker,), place)


def _queued(path: Path, stack: ExitStack) -> tuple[Any, int]:
    """Return a scheduler in this process whose workers are jobs of a cluster's queue, and how many there will be."""
    import dask
    import dask_jobqueue

    queues = {one.job_cls.config_name: one for one in vars(dask_jobqueue).values() if hasattr(one, "job_cls")}
    given = read_toml(path, str(Argument("scheduler")))
    known = f"give one of [{'], ['.join(sorted(filter(None, queues)))}] with jobs, cores, memory and walltime"
    name, table = next(iter(given.items()), ("", {}))
    if len(given) != 1 or name not in queues or not isinstance(table, dict):
        raise InputError(path, ", ".join(given) or "TOML", "is not a queue that dask-jobqueue knows", known)
    jobs, cores = table.pop("jobs", 1), table.get("cores", 1)
    for key, value in (("jobs", jobs), ("cores", cores)):
        if not isinstance(value, int) or value < 1:
            raise InputError(path, f"{name}.{key}", f"is {value!r}", "give a whole number from 1")
    # A task whose worker died is tried on one more.
    stack.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": 1}))
    try:
        # A process a core: PETSc can't run in several threads.
        cluster = stack.enter_context(queues[name](**{"cores": cores, "processes": cores} | table))
    except (TypeError, ValueError) as error:
        raise InputError(path, name, " ".join(str(error).split())[:200], known) from None
    cluster.adapt(minimum_jobs=jobs, maximum_jobs=jobs)  # so that a job that is lost is submitted again
    return cluster, jobs * cores


def outcomes[Task, Outcome](
    engine: Engine, work: Callable[[Task], Outcome], tasks: Sequence[Task]
) -> Iterator[tuple[int, Outcome | Died]]:
    """Yield tasks' places with their outcomes as they become known.

    No more tasks are handed over than workers can begin at once. Where a process dies, those that were begun are
    suspected: each is tried once more when the others are done, by itself, so that it is known which one it was.

    Parameters
    ----------
    engine
        Where they run.
    work
        Function of a task, picklable; what it raises is raised here.
    tasks
        Picklable.
    """
    waiting, suspects = list(range(len(tasks)))[::-1], list[int]()
    while waiting:
        begun: dict[Future[Outcome], int] = {}
        with engine.start() as executor:
            try:
                while waiting or begun:
                    while waiting and len(begun) < engine.workers:
                        place = waiting.pop()
                        begun[executor.submit(work, tasks[place])] = place
                    for future in wait(begun, return_when=FIRST_COMPLETED).done:
                        place = begun[future]
                        try:
                            outcome = future.result()
                        except engine.lost:
                            # Also what a dying worker had waiting beside it is lost.
                            suspects.append(place)
                        else:
                            yield place, outcome
                        del begun[future]
            except BrokenExecutor:
                for future, place in begun.items():
                    if future.done() and not future.cancelled() and future.exception() is None:
                        yield place, future.result()
                    else:
                        suspects.append(place)
    for place in suspects:
        with engine.start() if engine.lost else Processes(1) as executor:
            try:
                yield place, executor.submit(work, tasks[place]).result()
            except engine.lost as error:
                yield place, Died(f"its workers died one after another ({' '.join(str(error).split())[:200]})")
            except BrokenExecutor:
                yield place, Died(f"its process {how_ended(executor)}, twice")
