"""Run many cases, each in a process of its own, on this machine or on a Dask cluster."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from importlib.metadata import version
from threading import Thread
from typing import IO, Any, cast

from nena_shared import log
from nena_shared.settings import LogSettings
from nena_simulate.observation import Observed
from nena_simulate.report import Figures
from nena_simulate.simulation import observe
from nena_simulate.site import Case, check

CONNECT_SECONDS = 15
"""Time limit to reach a scheduler, and for its first worker."""
RETRIES = 2
"""How often a case is tried again whose process was lost, as for want of memory."""


class ClusterError(ValueError):
    """No cluster can be used under the address."""


class ProcessLostError(RuntimeError):
    """The process of a case ended without a result."""


def simulate_all(
    cases: Sequence[Case],
    executor: Executor,
    *,
    seeds: Sequence[int] = (),
    parts: int = 1,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[list[Figures], list[str]]:
    """Run each case with each of ``seeds``, or in ``parts``; return the figures, and which runs are missing.

    An interrupt ends it early, with the figures of the runs that are done. What a run raises is raised here.

    Raises:
        DemandError: a case has recorded orders, which cannot be split.
        ValueError: the robots of a case do not fit into its plant; nothing was started.

    """
    for case in cases:
        check(case)
    runs = [(number, one) for number, case in enumerate(cases) for one in case.runs(seeds, parts)]
    futures: dict[Future[Observed | Exception], tuple[int, Case]] = {}
    found: dict[int, dict[int, Observed]] = {number: {} for number in range(len(cases))}
    missing: list[str] = []
    try:
        futures.update((executor.submit(observe_apart, one), (number, one)) for number, one in runs)
        for done, future in enumerate(as_completed(futures), 1):
            number, one = futures[future]
            name = f"{one.plant.name}, {one.robots} robots, seed {one.seed}"
            try:
                result = future.result()
            except Exception as error:  # noqa: BLE001 - whatever a cluster loses is told, and the rest reported
                missing.append(f"{name}: no result: {type(error).__name__}: {error}")
                tell(missing[-1])
                continue
            if isinstance(result, Exception):
                raise result
            found[number][one.seed] = result
            tell(f"{done} of {len(runs)} done: {name}")
    except KeyboardInterrupt:
        missing.append(f"interrupted with {sum(map(len, found.values()))} of {len(runs)} runs done")
    finally:
        for future in futures:
            future.cancel()
    return [
        Figures.of([by_seed[seed] for seed in sorted(by_seed)], plant=case.plant.name, robots=case.robots)
        for case, by_seed in zip(cases, found.values(), strict=True)
        if by_seed
    ], missing


@contextmanager
def executor_for(address: str | None, jobs: int, *, runs: int = 0) -> Iterator[Executor]:
    """Yield what runs cases: ``jobs`` at a time here, or as many as a Dask cluster's workers have threads.

    If there is only one run, it needs no process of its own, whose start takes two seconds.

    Raises:
        ClusterError: Dask is not installed, the address does not answer, or no worker can run cases.

    """
    if address is None and runs == 1:
        yield _Here()
        return
    if address is None:
        pool = ThreadPoolExecutor(jobs)  # each thread waits for the process of a case
        try:
            yield pool
        finally:
            pool.shutdown(cancel_futures=True)
        return
    try:
        from dask.distributed import Client  # noqa: PLC0415 - an extra
    except ImportError as error:
        message = "--on needs Dask: pip install 'nena-simulate[cluster]'"
        raise ClusterError(message) from error
    try:
        client = Client(address, timeout=CONNECT_SECONDS)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        message = f"no Dask scheduler at {address}: {error}"
        raise ClusterError(message) from error
    with client:
        _check_workers(address, client.wait_for_workers, client.run)
        # pure: equal cases would otherwise count as one.
        yield cast("Executor", client.get_executor(retries=RETRIES, pure=False))  # type: ignore[no-untyped-call]


def _check_workers(
    address: str, wait: Callable[..., object], run_on_each: Callable[..., dict[str, str]]
) -> None:
    """Check that the workers have this version. Raises ClusterError."""
    ours = installed_version()
    try:
        wait(1, timeout=CONNECT_SECONDS)
        theirs = run_on_each(installed_version)
    except TimeoutError as error:
        message = f"the scheduler at {address} has no workers; start them with: dask worker {address}"
        raise ClusterError(message) from error
    except ImportError as error:
        message = f"the workers of {address} need nena-simulate {ours}, as installed here: {error}"
        raise ClusterError(message) from error
    if other := sorted(f"{worker} has {each}" for worker, each in theirs.items() if each != ours):
        message = f"the workers need nena-simulate {ours}, as installed here: {', '.join(other)}"
        raise ClusterError(message)


def installed_version() -> str:
    """Return the version of this program."""
    return version("nena-simulate")


class _Here(Executor):
    """Runs cases at once, in this process."""

    def submit(self, _apart: object, /, case: Case) -> Future[Any]:  # type: ignore[override]
        """Run a case; return what was observed."""
        future: Future[Any] = Future()
        future.set_result(_observe(case))
        return future


def observe_apart(case: Case) -> Observed | Exception:
    """Run a case in a process of its own, whose sets have the same order each time.

    A worker of a cluster may be a daemon, which multiprocessing refuses children.

    Raises:
        ProcessLostError: it ended without a result.

    """
    # Python reads the hash seed at its start only.
    environment = {**os.environ, "PYTHONHASHSEED": "0"}
    command = [sys.executable, "-m", "nena_simulate.sweep"]
    with subprocess.Popen(  # noqa: S603 - our own module
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment
    ) as process:
        stdin, stdout = cast("IO[bytes]", process.stdin), cast("IO[bytes]", process.stdout)
        stdin.write(pickle.dumps(case))
        stdin.flush()  # it remains open: its end tells the process that nobody waits any more
        answer = stdout.read()
    if not answer:
        message = f"the process ended with status {process.returncode}"
        raise ProcessLostError(message)
    result = pickle.loads(answer)  # noqa: S301  # nosec B301 - from our own process
    return cast("Observed | Exception", result)


def _observe_case_of_stdin() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    answers, sys.stdout = sys.stdout.buffer, sys.stderr  # whatever is printed is no answer
    case = pickle.load(sys.stdin.buffer)  # noqa: S301  # nosec B301 - from the process that started this one

    def wait_for_end() -> None:
        os.read(sys.stdin.fileno(), 1)
        os._exit(1)

    Thread(target=wait_for_end, daemon=True).start()
    answers.write(pickle.dumps(_observe(case)))
    answers.flush()


def _observe(case: Case) -> Observed | Exception:
    log.configure(LogSettings(level="error"))
    try:
        return observe(case)
    except Exception as error:  # noqa: BLE001 - raised again where the result is read
        return error


if __name__ == "__main__":
    _observe_case_of_stdin()
