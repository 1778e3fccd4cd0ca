"""The acceptance suite for any Nav2, here against the simulator."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from functools import partial

import pytest

from nav2_acceptance.checks import CHECKS
from nav2_acceptance.report import FAILED, LEFT_OUT, OK, Finding, as_json, as_markdown, run
from nav2_acceptance.simulated import simulated_site
from nav2_acceptance.site import BOND, Nav2Site
from support.broker import Broker, free_port
from support.pausing import time_passes

IN_EACH_RUN = "acdijkl"
"""Those that take seconds; the others' subjects have tests of their own beside this one."""


@pytest.mark.ros
@pytest.mark.broker
async def test_the_simulator_passes() -> None:
    with simulated_site(time_factor=2.0) as site:
        findings = await run(site, IN_EACH_RUN)
    assert [each.letter for each in findings if each.verdict != OK] == [], as_markdown(findings)


@pytest.mark.ros
@pytest.mark.broker
async def test_delocalised_robot_is_given_its_position() -> None:
    """As in a simulation that has just started, such as nav2_loopback_sim."""
    with simulated_site(localisation={"known_at_start": False}) as site:
        site.pose = (0.0, 0.0)
        (finding,) = await run(site, "a")
    assert finding.verdict == OK, finding.text


async def test_failed_check_is_reported_and_the_next_one_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    async def fail(_: Nav2Site) -> str:
        message = "it drove | on\nand on"
        raise AssertionError(message)

    async def work(_: Nav2Site) -> str:
        return "well"

    monkeypatch.setitem(CHECKS, "a", ("doctor", fail))
    monkeypatch.setitem(CHECKS, "b", ("orders", work))
    told: list[str] = []
    site = Nav2Site(None, None, tell=told.append)  # type: ignore[arg-type]
    findings = await run(site, "ab")
    assert told[0] == "a doctor ...", "told before it runs"
    assert "FAILED" in told[1]
    assert told[-1].endswith("well")
    assert [each.verdict for each in findings] == [FAILED, OK]
    assert "| a | doctor | FAILED | AssertionError: it drove / on and on |" in as_markdown(findings)
    assert [each["letter"] for each in json.loads(as_json(findings))] == ["a", "b"]


FAILS = "as it happens"


async def leave_an_order(site: Nav2Site) -> str:
    async with site.agent():
        site.send(site.far)
        await site.moves()
        raise AssertionError(FAILS)


async def kill_a_server(site: Nav2Site, server: str) -> str:
    async with site.agent():
        site.send(site.far)
        await site.moves()
        await site.die(server)
        await site.stands()
        await time_passes(BOND + 1.0)
        raise AssertionError(FAILS)


async def close_in_for_good(site: Nav2Site) -> str:
    await site.close_in()
    async with site.agent():
        site.send(site.course.obstacle or site.far)
        await site.when(lambda state: state["driving"] or state["errors"], since=0)
        raise AssertionError(FAILS)


@pytest.mark.ros
@pytest.mark.broker
@pytest.mark.parametrize(
    "leave",
    [
        leave_an_order,
        partial(kill_a_server, server="bt_navigator"),
        partial(kill_a_server, server="amcl"),
        close_in_for_good,
    ],
    ids=["an order", "without bt_navigator", "without amcl", "in a recovery"],
)
async def test_whatever_a_failed_check_leaves_the_next_one_passes(
    monkeypatch: pytest.MonkeyPatch, leave: Callable[[Nav2Site], Awaitable[str]]
) -> None:
    monkeypatch.setitem(CHECKS, "a", ("fails", leave))
    with simulated_site() as site:
        findings = await run(site, "aci")
    assert [each.verdict for each in findings] == [FAILED, OK, OK], as_markdown(findings)


def test_the_broker_uses_the_given_port() -> None:
    port = free_port()
    broker = Broker(port=port)
    try:
        assert broker.settings.port == port
    finally:
        broker.close()


async def test_checks_that_are_impossible_at_a_site_are_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    async def kill(site: Nav2Site) -> str:
        await site.die("amcl")
        return "dead"

    monkeypatch.setitem(CHECKS, "g", ("deaths", kill))
    site = Nav2Site(None, None)  # type: ignore[arg-type]
    (finding,) = await run(site, "g")
    assert finding.verdict == LEFT_OUT
    assert "--kill" in finding.text
    assert isinstance(finding, Finding)
