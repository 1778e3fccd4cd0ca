"""An agent that dies at any moment of an order: the result is the same as without its death.

The whole agent runs, with its journal on disk, over a link, a driver and actions that let it die before,
during or after each of its effects on the world, and before each input. Then another agent continues with the
same journal and the same robot, which has driven on meanwhile.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from support.examples import RESTARTS
from support.restarts.life import Death, History, live
from support.restarts.oracle import check, check_end
from support.restarts.scenarios import SCENARIOS

pytestmark = pytest.mark.simulation

PAUSES = (0.3, 2.0, 20.0)
"""Seconds without an agent: the robot is on its way, near to its goal, or has stood there for a while."""
ALWAYS = 10_000
"""Records: more than an agent writes."""


@pytest.fixture
def folder() -> Iterator[Path]:
    """Return a folder for journals, in memory if possible: the disk does not matter here."""
    memory = Path("/dev/shm")  # noqa: S108 - the folder in it is our own
    with TemporaryDirectory(dir=memory if memory.is_dir() else None, prefix="nena-test-") as name:
        yield Path(name)


@pytest.fixture
def undisturbed(scenario: str, folder: Path) -> History:
    history = live(SCENARIOS[scenario], folder / "undisturbed")
    check(history)
    return history


@pytest.mark.clause("6.6/restart", "7.2/headerId")
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_a_crash_at_any_moment_leads_to_the_same_result(
    scenario: str, undisturbed: History, folder: Path
) -> None:
    moments = range(1, len(undisturbed.lives[0]) + 1)
    chance = random.Random(scenario)
    for moment in sorted(chance.sample(moments, min(RESTARTS, len(moments)))):
        death = Death(moment, chance.choice(PAUSES))
        _live_and_check([death], undisturbed, folder / str(moment))


@pytest.mark.clause("6.6/restart", "7.2/headerId")
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_several_crashes_lead_to_the_same_result(scenario: str, undisturbed: History, folder: Path) -> None:
    chance = random.Random(scenario)
    for number in range(RESTARTS // 4):
        deaths = [Death(chance.randint(1, 60), chance.choice(PAUSES)) for _ in range(chance.randint(2, 5))]
        _live_and_check(deaths, undisturbed, folder / str(number))


@pytest.mark.clause("6.6/restart", "6.6.5.4")
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_a_disk_failure_with_or_without_a_crash_leads_to_the_same_result(
    scenario: str, undisturbed: History, folder: Path
) -> None:
    chance = random.Random(scenario)
    for number in range(RESTARTS // 4):
        first = chance.randint(1, 12)  # the first one sets headerIds apart
        failing = range(first, chance.choice((first + 3, ALWAYS)))
        death = Death(chance.randint(20, 150), chance.choice(PAUSES), failing)
        _live_and_check([death], undisturbed, folder / str(number))


def _live_and_check(deaths: list[Death], undisturbed: History, folder: Path) -> None:
    try:
        history = live(undisturbed.scenario, folder, deaths)
        check(history)
        check_end(history, undisturbed)
    except (AssertionError, TimeoutError) as error:
        first = undisturbed.lives[0][deaths[0].moment - 1 : deaths[0].moment]
        error.add_note(f"deaths: {deaths}, the first one at: {first}")
        raise
