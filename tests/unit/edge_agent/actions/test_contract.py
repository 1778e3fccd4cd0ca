"""The contract suite: every ready-made plug-in keeps it, and every deliberately bad one is found."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from nena_edge_agent.actions.check_plugin import findings_of
from nena_edge_agent.actions.contract import CHECKS, Check, Finding, Verdict, ends
from nena_edge_agent.actions.plugin import ActionPlugin
from nena_edge_agent.actions.run import Patience
from nena_edge_agent.actions.trial import Subject
from nena_edge_agent.protocol.declaration import ActionDeclaration
from support.bad_plugins import BAD, NODE, Good, Hangs, NeverEnds, made

PATIENCE = Patience(begin=0.3, obey=0.3)
PATIENT = Patience(begin=30.0, obey=30.0)
SEEN_AT_THE_END = ("Nothing left", "Does not block")


def findings(
    plugin: ActionPlugin,
    *,
    seconds: float = 30.0,
    checks: Sequence[Check] = CHECKS,
    patience: Patience = PATIENCE,
) -> dict[str, Finding]:
    subject = Subject(plugin, patience=patience, seconds=seconds)
    return {each.check: each for each in findings_of(subject, checks)}


def named(name: str) -> Check:
    return next(each for each in CHECKS if str(each.__doc__).startswith(f"{name}:"))


def test_a_good_plug_in_keeps_it() -> None:
    found = findings(Good(), patience=PATIENT)

    assert {each.verdict for each in found.values()} == {Verdict.OK}, found


@pytest.mark.parametrize("name", list(BAD))
def test_a_bad_plug_in_is_found(name: str) -> None:
    plugin, check = BAD[name]
    seconds = 1.0 if name == "never ends" else 30.0

    checks = [ends if check in SEEN_AT_THE_END else named(check)]
    found = findings(plugin, seconds=seconds, checks=checks)[check]

    assert found.verdict is Verdict.BROKEN, found
    assert found.text
    assert found.remedy


def test_one_that_hangs_is_found_with_the_place() -> None:
    found = findings(made(Hangs), checks=[ends])

    assert found["Does not block"].verdict is Verdict.BROKEN
    assert "for ever" in found["Does not block"].text
    assert "in __init__" in found["Does not block"].text


def test_what_gives_no_occasion_is_not_called_good() -> None:
    found = findings(made(NeverEnds, ActionDeclaration("good", NODE, timeout=60.0)), seconds=1.0)

    assert found["Start to end"].verdict is Verdict.NOT_SEEN
    assert "fails after 60 s" in found["Start to end"].text
    assert found["Pause and resume"].verdict is Verdict.NOT_SEEN
