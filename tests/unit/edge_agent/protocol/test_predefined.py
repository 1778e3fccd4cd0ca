"""Which of the standard's actions a robot of each version knows (section 6.2.3)."""

from __future__ import annotations

import pytest

from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_edge_agent.protocol.predefined import MAP_ACTIONS, PREDEFINED, spoken
from nena_edge_agent.protocol.rules import RULES
from nena_shared.vda5050.factsheet import ActionScope
from support.robot_core import Bench, action

IN_ALL = {
    "cancelOrder",
    "startPause",
    "stopPause",
    "stateRequest",
    "factsheetRequest",
    "initializePosition",
    "waitForTrigger",
}
ONLY_IN_3 = {
    "clearInstantActions",
    "trigger",
    "retry",
    "skipRetry",
    "enableZoneSet",
    "deleteZoneSet",
    "downloadZoneSet",
}
OF_PLUG_INS = {
    name: ActionDeclaration(name, (ActionScope.INSTANT,)) for name in (*MAP_ACTIONS, "downloadZoneSet")
}


@pytest.mark.clause("6.2.3")
@pytest.mark.parametrize(
    ("version", "known"),
    [
        ("2.0.0", IN_ALL),
        ("2.1.0", IN_ALL | MAP_ACTIONS),
        ("3.0.0", IN_ALL | MAP_ACTIONS | ONLY_IN_3),
    ],
)
def test_a_robot_knows_those_of_its_version(version: str, known: set[str]) -> None:
    assert set(spoken(PREDEFINED | OF_PLUG_INS, RULES[version].standard)) == known


@pytest.mark.clause("6.2.3/cancelOrder")
@pytest.mark.parametrize("version", RULES)
@pytest.mark.parametrize("name", ["cancelOrder", "startPause", "stopPause"])
def test_what_every_robot_must_be_able_to_do_is_for_instant_actions_alone(version: str, name: str) -> None:
    assert Bench(rules=RULES[version]).capabilities.actions[name].scopes == (ActionScope.INSTANT,)


@pytest.mark.clause(
    "6.2.3/clearZoneActions",
    "6.2.3/detectObject",
    "6.2.3/shutdown",
    "6.2.3/startHibernation",
    "6.2.3/updateCertificate",
)
@pytest.mark.parametrize(
    "name",
    [
        "clearZoneActions",
        "detectObject",
        "finePositioning",
        "shutdown",
        "startHibernation",
        "stopHibernation",
        "updateCertificate",
    ],
)
def test_what_a_robot_cannot_do_it_does_not_list_and_refuses(name: str) -> None:
    bench = Bench(rules=RULES["3.0.0"])

    bench.instant(action("i", "NONE", name))

    assert name not in bench.capabilities.actions
    assert bench.status("i") == "FAILED"
    assert bench.errors == ["INVALID_INSTANT_ACTION"]
