"""How a NeNa program starts and ends: one clear line for each mistake, an orderly end for each signal."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Awaitable, Callable, Sequence

from nena_shared import log
from nena_shared.settings import ConfigurationError, S, load
from nena_shared.signs_of_life import signs_of_life
from nena_shared.tasks import TaskFailedError, stop_on_signals

EXIT_FAILED = 1
EXIT_MISCONFIGURED = 2


class StartError(Exception):
    """The program cannot start; the text says why, and what to do."""


def run(
    settings: type[S],
    serve: Callable[[S, asyncio.Event], Awaitable[None]],
    *,
    program: str,
    description: str,
    argv: Sequence[str] | None = None,
) -> int:
    """Read the settings, serve until SIGINT or SIGTERM, and give the exit status.

    ``serve`` gets the settings and an event that is set when the program shall end.
    """
    try:
        chosen = load(
            settings, sys.argv[1:] if argv is None else argv, program=program, description=description
        )
        log.configure(chosen.log)
        asyncio.run(_serve(chosen, serve))
        log.get_logger(__name__).info("program ended", program=program)
    except ConfigurationError as error:
        for problem in error.problems:
            sys.stderr.write(f"{program}: setting {problem}\n")
        return EXIT_MISCONFIGURED
    except (StartError, TaskFailedError) as error:
        told = f"{error}: {error.__cause__}" if isinstance(error.__cause__, StartError) else str(error)
        sys.stderr.write(f"{program}: {told}\n")
        return EXIT_FAILED
    return 0


async def _serve(settings: S, serve: Callable[[S, asyncio.Event], Awaitable[None]]) -> None:
    stop = asyncio.Event()
    stop_on_signals(stop)
    async with signs_of_life(stop):
        await serve(settings, stop)
