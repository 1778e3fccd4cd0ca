"""Several robots in one program: each one fails and restarts independently."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from typing import Protocol

from nena_shared.log import get_logger
from nena_shared.tasks import StartError, Supervisor, TaskFailedError, set_within

log = get_logger(__name__)

MAXIMUM_RESTART_DELAY = 60.0
"""Maximum interval between two starts of a robot, seconds."""


class Agent(Protocol):
    """The agent of one robot."""

    async def run(self, stop: asyncio.Event) -> None:
        """Run until ``stop`` is set."""
        ...


async def run_fleet(
    makers: Mapping[str, Callable[[], Agent]], stop: asyncio.Event, *, restarts: int, pause: float
) -> None:
    """Run the robots until ``stop`` is set; ``makers`` create their agents, by robot name.

    A failed robot is restarted up to ``restarts`` times: after ``pause`` s, then after twice as long, and so
    on. A robot that was shut down is not restarted.

    Raises:
        StartError: no robot is running any more, and at least one has failed.
    """
    abandoned: list[str] = []

    async def run_robot(name: str, make: Callable[[], Agent]) -> None:
        for attempt in range(restarts + 1):
            try:
                # A new agent each time: it reads the journal again, so that a failure leaves no half state.
                await make().run(stop)
            except (StartError, TaskFailedError) as error:
                log.error("robot failed", robot=name, reason=str(error))  # noqa: TRY400 - the reason suffices
            except Exception:
                log.exception("robot failed", robot=name)
            else:
                return
            if attempt < restarts:
                seconds = min(pause * 2**attempt, MAXIMUM_RESTART_DELAY)
                log.info("restarting robot", robot=name, in_seconds=seconds, restarts_left=restarts - attempt)
                if await set_within(stop, seconds):
                    return
        log.error("robot abandoned; the others continue", robot=name, starts=restarts + 1)
        abandoned.append(name)

    async with Supervisor() as supervisor:
        tasks = [
            supervisor.start(f"agent {name}", run_robot(name, make), vital=False)
            for name, make in makers.items()
        ]
        await asyncio.gather(*tasks)
    if abandoned and not stop.is_set():
        raise StartError("no robot is running; see the log for the reasons")
