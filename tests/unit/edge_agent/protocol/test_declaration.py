"""Which of the standard's actions a robot of each version knows (section 6.2.3)."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import JsonValue

from nena_edge_agent.protocol.declaration import (
    MAP_ACTIONS,
    PREDEFINED,
    ActionDeclaration,
    LoadChange,
    Parameter,
    supported_actions,
)
from nena_shared.vda5050.action import BlockingType
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from nena_shared.vda5050.versions import RULES
from support.robot_core import Bench, action

HEIGHT = Parameter("height", ValueDataType.NUMBER, minimum=0.0, maximum=2.0, description="m")
SIDE = Parameter("side", ValueDataType.STRING, required=False, choices=("left", "right"))
LIFT = ActionDeclaration(
    "lift",
    (ActionScope.NODE, ActionScope.INSTANT),
    parameters=(HEIGHT, SIDE),
    blocking_types=(BlockingType.HARD,),
    load=LoadChange.TAKE,
)


@pytest.mark.parametrize(
    ("value", "problem"),
    [
        (1, None),
        (2.0, None),
        (None, "is missing"),
        ("1", "must be of type NUMBER"),
        (True, "must be of type NUMBER"),
        (10**400, "must be of type NUMBER"),
        (-0.1, "must be at least 0 and at most 2"),
        (2.1, "must be at least 0 and at most 2"),
    ],
)
def test_a_value_is_checked_by_type_and_range(value: JsonValue, problem: str | None) -> None:
    found = HEIGHT.problem(value)
    assert found is None if problem is None else found is not None and problem in found


def test_only_the_listed_values_of_a_choice_are_accepted() -> None:
    assert SIDE.problem("left") is None
    assert SIDE.problem(None) is None
    assert SIDE.problem("up") == "parameter 'side' must be one of left, right"


def test_an_empty_array_counts_as_missing() -> None:
    listed = Parameter("zones", ValueDataType.ARRAY)
    assert listed.problem([]) == "parameter 'zones' is missing"
    assert listed.problem(["z"]) is None


def test_the_description_lists_the_allowed_values() -> None:
    assert HEIGHT.words == "m, at least 0 and at most 2"
    assert SIDE.words == "one of left, right"


PICK = ActionDeclaration(
    "pick", (ActionScope.NODE,), parameters=(Parameter("lhd", ValueDataType.STRING, required=False),)
)


@pytest.mark.clause("6.2.3/pick")
@pytest.mark.parametrize("key", ["lhd", "loadHandlingDevice"])
def test_the_load_handling_device_is_read_by_either_name(key: str) -> None:
    parameters: dict[str, Any] = {"side": "left", key: "fork"}
    read = PICK.read(action("a", "HARD", "pick", **parameters))
    assert (read.parameter("lhd"), read.parameter("side")) == ("fork", "left")
    assert PICK.problem(read, ActionScope.NODE) is None


@pytest.mark.clause("6.2.3/pick")
def test_two_load_handling_devices_are_refused() -> None:
    both = action("a", "HARD", "pick", lhd="fork", loadHandlingDevice="belt")
    assert "different load handling devices" in (PICK.problem(PICK.read(both), ActionScope.NODE) or "")
    same = action("a", "HARD", "pick", lhd="fork", loadHandlingDevice="fork")
    assert PICK.problem(PICK.read(same), ActionScope.NODE) is None
    other = action("a", "HARD", "lift", lhd="fork", loadHandlingDevice="belt", height=1)
    assert LIFT.problem(LIFT.read(other), ActionScope.NODE) is None


@pytest.mark.parametrize(
    ("blocking", "scope", "height", "problem"),
    [
        ("HARD", ActionScope.NODE, 1, None),
        ("SOFT", ActionScope.NODE, 1, "cannot have the blocking type SOFT"),
        ("SOFT", ActionScope.INSTANT, 1, None),
        ("HARD", ActionScope.EDGE, 1, "not possible with scope EDGE, only NODE, INSTANT"),
        ("HARD", ActionScope.NODE, 3, "action 'lift': parameter 'height' must be"),
    ],
)
def test_an_action_is_checked_by_scope_blocking_type_and_parameters(
    blocking: str, scope: ActionScope, height: float, problem: str | None
) -> None:
    found = LIFT.problem(action("a", blocking, "lift", height=height), scope)
    assert found is None if problem is None else found is not None and problem in found


def test_a_custom_check_runs_last() -> None:
    checked = ActionDeclaration(
        "lift", (ActionScope.NODE,), parameters=(HEIGHT,), check=lambda _: "the belt slips"
    )
    assert (
        checked.problem(action("a", "HARD", "lift", height=1), ActionScope.NODE)
        == "action 'lift': the belt slips"
    )
    assert "height" in str(checked.problem(action("a", "HARD", "lift"), ActionScope.NODE))


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
def test_a_robot_has_the_actions_of_its_version(version: str, known: set[str]) -> None:
    assert set(supported_actions(PREDEFINED | OF_PLUG_INS, RULES[version])) == known


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
def test_unsupported_actions_are_not_listed_and_refused(name: str) -> None:
    bench = Bench(rules=RULES["3.0.0"])

    bench.instant(action("i", "NONE", name))

    assert name not in bench.capabilities.actions
    assert bench.status("i") == "FAILED"
    assert bench.errors == ["INVALID_INSTANT_ACTION"]
