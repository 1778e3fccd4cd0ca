"""Fleet control asks for what the factsheet offers."""

from __future__ import annotations

from typing import Any

import pytest

from nena_cli.vda5050.finding import Rule, Severity
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.factsheet import ActionScope, Factsheet, MobileRobotAction
from support.fleet_examples import factsheet
from support.robot_core import action
from support.talk import VERSIONS, Talk


def offering(*scopes: ActionScope) -> Factsheet:
    sheet = factsheet()
    work = MobileRobotAction(
        action_type="work", action_scopes=scopes, pause_allowed=False, cancel_allowed=False
    )
    features = sheet.protocol_features.model_copy(update={"mobile_robot_actions": (work,)})
    return sheet.model_copy(update={"protocol_features": features})


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(
    ("asked", "place", "fine"),
    [
        (action("a"), {"node_actions": "n0"}, True),
        (action("a"), {"edge_actions": "n0-n1"}, False),
        (action("a", "NONE", "dance"), {"node_actions": "n0"}, False),
    ],
)
def test_actions_of_orders_are_offered(
    version: str, asked: Action, place: dict[str, str], *, fine: bool
) -> None:
    talk = Talk(version).say(offering(ActionScope.NODE))
    fields: dict[str, Any] = {key: {name: [asked]} for key, name in place.items()}
    talk.order("n0", "n1", **fields)

    assert talk.rules == ([] if fine else [Rule.NOT_OFFERED])
    assert {each.severity for each in talk.findings} <= {Severity.WARNING}


def test_instant_actions_are_offered() -> None:
    fine = Talk().say(offering(ActionScope.INSTANT)).act(action("a"))
    not_here = Talk().say(offering(ActionScope.NODE)).act(action("a"))

    assert fine.rules == []
    assert not_here.rules == [Rule.NOT_OFFERED]
    assert not_here.findings[0].section == "7.10"


def test_without_a_factsheet_nobody_knows() -> None:
    assert Talk().act(action("a", "NONE", "dance")).rules == []
