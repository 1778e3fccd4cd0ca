"""The acceptance suite for any Nav2, here against the simulator."""

from __future__ import annotations

import json

import pytest

from nav2_acceptance.checks import CHECKS
from nav2_acceptance.report import FAILED, LEFT_OUT, OK, Finding, as_json, as_markdown, run
from nav2_acceptance.simulated import simulated_site
from nav2_acceptance.site import Nav2Site

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
    findings = await run(None, "ab")  # type: ignore[arg-type]
    assert [each.verdict for each in findings] == [FAILED, OK]
    assert "| a | doctor | FAILED | AssertionError: it drove / on and on |" in as_markdown(findings)
    assert [each["letter"] for each in json.loads(as_json(findings))] == ["a", "b"]


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
