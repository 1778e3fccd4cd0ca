"""Every row of the decision table of sections 6.1.2 and 6.1.4, and what each leaves as it was."""

from __future__ import annotations

from typing import Any

import pytest

from nena_edge_agent.driver.port import Circle, NoRouteReport
from nena_edge_agent.protocol.declaration import ActionDeclaration, Parameter
from nena_edge_agent.protocol.events import MapsReport, OperatingModeSwitched, ReportState
from nena_edge_agent.protocol.memory import Memory
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorType
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from nena_shared.vda5050.order import Corridor, NodePosition, Order
from nena_shared.vda5050.state import Map, MapStatus, OperatingMode
from nena_shared.vda5050.versions import RULES
from support.robot_core import ACTIONS, MAP, Bench, action, at, order, position


def references(entry: ErrorEntry) -> dict[str, str]:
    return {each.reference_key: each.reference_value for each in entry.error_references}


def refused(bench: Bench, wrong: Order) -> ErrorEntry:
    """Send ``wrong``; return the error, and check that nothing else has changed."""
    before, errors = bench.state, set(bench.state.errors)
    effects = bench.send(wrong)
    after = bench.state
    assert effects == [ReportState()]
    assert after.model_copy(update={"errors": before.errors}) == before
    (new,) = set(after.errors) - errors
    return new


@pytest.mark.clause("6.1.4.1")
def test_row_1_an_order_without_an_id_is_refused_and_not_mistaken_for_the_current_one() -> None:
    entry = refused(Bench(), order("n0", "n1", order_id=""))

    assert entry.error_type == ErrorType.VALIDATION_FAILURE


@pytest.mark.clause("7.1.2")
def test_row_3_also_counts_actions() -> None:
    bench = Bench(maximum_actions=1)

    entry = refused(bench, order("n0", node_actions={"n0": [action("a"), action("b")]}))

    assert entry.error_type == ErrorType.INSUFFICIENT_MEMORY


@pytest.mark.clause("6.1.4.2", "7.3/speed")
@pytest.mark.parametrize(
    ("limit", "limits_speed", "taken"),
    [(0.5, True, True), (0.5, False, False), (1.2, False, True), (None, False, True)],
)
def test_row_4_a_speed_limit_that_the_robot_cannot_keep_is_refused(
    *, limit: float | None, limits_speed: bool, taken: bool
) -> None:
    bench = Bench(maximum_speed=1.2, limits_speed=limits_speed)
    sent = order("n0", "n1", edge_fields={"maximum_speed": limit})

    if taken:
        bench.send(sent)
        assert bench.state.order_id == "o1"
    else:
        entry = refused(bench, sent)
        assert entry.error_type == ErrorType.UNSUPPORTED_PARAMETER
        assert references(entry)["parameter"] == "edges.maximumSpeed"


@pytest.mark.clause("6.1.4.2", "7.3/edge")
def test_row_4_values_that_match_the_default_behaviour_are_accepted() -> None:
    bench = Bench()

    bench.send(
        order("n0", "n1", edge_fields={"orientation": 0.0, "reach_orientation_before_entering": False})
    )

    assert bench.state.order_id == "o1"


@pytest.mark.clause("6.1.4", "6.1.4.3", "6.6.5.2")
@pytest.mark.parametrize(
    "wrong",
    [
        action("x", action_type="dance"),
        action("x", action_type="cancelOrder"),
        action("x", action_type="lift"),
        action("x", action_type="lift", height="high"),
        action("x", action_type="lift", height=True),
    ],
    ids=["unknown", "wrong scope", "parameter missing", "parameter of wrong type", "a truth value as number"],
)
@pytest.mark.parametrize("released", [1, 2], ids=["horizon", "base"])
def test_row_5_an_impossible_action_is_refused_even_in_the_horizon(wrong: object, released: int) -> None:
    bench = Bench()

    entry = refused(bench, order("n0", "n1", released=released, node_actions={"n1": [wrong]}))  # type: ignore[list-item]  # parametrized

    assert entry.error_type == ErrorType.INVALID_ORDER_ACTION
    assert entry.error_level is ErrorLevel.WARNING
    assert references(entry) == {
        "topic": "order",
        "headerId": "7",
        "orderId": "o1",
        "orderUpdateId": "0",
        "actionId": "x",
    }


@pytest.mark.clause("6.1.4.6", "6.6.8")
def test_row_a1_a_robot_at_its_decision_point_with_a_horizon_is_not_idle() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", released=1))

    assert refused(bench, order("n0", order_id="o2")).error_type == ErrorType.OTHER_ORDER_ACTIVE


@pytest.mark.clause("6.1.4.6", "6.6.8")
def test_row_a1_a_running_action_keeps_the_robot_busy_and_a_failed_one_does_not() -> None:
    bench = Bench()
    bench.send(order("n0", node_actions={"n0": [action("a")]}))
    assert refused(bench, order("n0", order_id="o2")).error_type == ErrorType.OTHER_ORDER_ACTIVE

    bench.fails("a")
    bench.send(order("n0", order_id="o2"))

    assert bench.state.order_id == "o2"


@pytest.mark.clause("6.1.4.6", "6.6.8")
def test_row_a1_instant_actions_do_not_keep_the_robot_busy() -> None:
    bench = Bench()
    bench.instant(action("i", action_type="work"))
    bench.runs("i")

    bench.send(order("n0"))

    assert bench.state.order_id == "o1"
    assert bench.status("i") == "RUNNING"


@pytest.mark.clause("6.1.2/A2")
def test_row_a2_an_order_whose_beginning_was_lost_is_refused() -> None:
    bench = Bench()

    entry = refused(bench, order("n0", "n1", first=4, update=1))

    assert entry.error_type == ErrorType.VALIDATION_FAILURE
    assert references(entry)["orderUpdateId"] == "1"


@pytest.mark.clause("6.1.4.7")
@pytest.mark.parametrize(
    ("radius", "taken"), [(None, False), (0.0, False), (9.9, False), (10.1, True)], ids=str
)
def test_row_a4_the_first_node_may_allow_a_large_deviation(radius: float | None, taken: bool) -> None:  # noqa: FBT001
    bench = Bench()

    bench.send(order("n1", positions={"n1": position(10.0, radius=radius)}))

    assert (bench.state.order_id == "o1") is taken


@pytest.mark.clause("6.1.4.7", "7.3/deviation")
def test_row_a4_the_robots_deviation_applies_if_the_node_has_none() -> None:
    bench = Bench(default_deviation_xy=10.5)

    bench.send(order("n1"))

    assert bench.state.order_id == "o1"


@pytest.mark.clause("6.1.4.7")
def test_row_a4_the_node_that_the_robot_reports_counts_without_a_position() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.arrive()

    bench.send(order("n1", "n2", order_id="o2", positions={"n1": None}))

    assert bench.state.order_id == "o2"


@pytest.mark.clause("6.1.4.7")
def test_row_a4_a_robot_that_has_left_its_last_node_is_not_there() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.instant(action("c", action_type="cancelOrder"))
    bench.halted()
    bench.do(at(5.0))

    assert refused(bench, order("n0", order_id="o2")).error_type == ErrorType.START_NODE_OUT_OF_RANGE


@pytest.mark.clause("6.1.4.7")
def test_row_a4_a_robot_that_was_driven_away_by_hand_is_not_there() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.arrive()

    bench.do(at(13.0))
    entry = refused(bench, order("n1", "n2", order_id="o2"))
    bench.do(at(10.8))
    bench.send(order("n1", "n2", order_id="o2"))

    assert entry.error_type == ErrorType.START_NODE_OUT_OF_RANGE
    assert bench.state.order_id == "o2"


@pytest.mark.clause("6.1.4.7")
def test_row_a4_a_robot_without_a_position_reports_it() -> None:
    bench = Bench(ready=False)

    entry = refused(bench, order("n0", "n1"))

    assert entry.error_type == ErrorType.START_NODE_OUT_OF_RANGE
    assert "not known" in str(entry.error_description)


@pytest.mark.clause("6.1.4.8")
@pytest.mark.parametrize("released", [2, 3])
def test_row_a5_a_node_without_a_route_is_refused_even_in_the_horizon(released: int) -> None:
    bench = Bench()
    bench.do(NoRouteReport((Circle(20.0, 0.0, 0.5),)))

    entry = refused(bench, order("n0", "n1", "n2", released=released))

    assert entry.error_type == ErrorType.NO_ROUTE_TO_TARGET
    assert references(entry)["nodeId"] == "n2"
    bench.do(NoRouteReport(()))
    bench.send(order("n0", "n1", "n2"))
    assert bench.errors == []


def held() -> Bench:
    """A robot on its way from n0 to n1, the decision point; n2 is horizon."""
    bench = Bench()
    bench.send(order("n0", "n1", "n2", update=3, released=2))
    return bench


@pytest.mark.clause("6.1.3.1")
@pytest.mark.parametrize("ended", [False, True], ids=["being cancelled", "cancelled"])
def test_row_b2_no_update_follows_a_cancel(ended: bool) -> None:  # noqa: FBT001
    bench = held()
    bench.instant(action("c", action_type="cancelOrder"))
    if ended:
        bench.halted()

    for update in (3, 4):  # a late duplicate draws the same warning
        entry = refused(bench, order("n1", "n2", update=update, first=2))
        assert entry.error_type == ErrorType.ORDER_UPDATE_FOLLOWING_CANCEL


@pytest.mark.clause("6.1.1/ids")
def test_an_action_id_in_use_is_refused() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", node_actions={"n1": [action("a")]}))

    entry = refused(bench, order("n1", "n2", update=1, first=2, node_actions={"n2": [action("a")]}))

    assert entry.error_type == ErrorType.INVALID_ORDER_ACTION
    assert references(entry)["actionId"] == "a"


@pytest.mark.clause("6.1.1/ids")
def test_the_id_of_an_instant_action_is_refused_in_an_order() -> None:
    bench = Bench()
    bench.instant(action("a"))

    entry = refused(bench, order("n0", node_actions={"n0": [action("a")]}))

    assert entry.error_type == ErrorType.INVALID_ORDER_ACTION


@pytest.mark.clause("6.1.2/A2")
@pytest.mark.parametrize(
    ("version", "taken"), [("2.0.0", True), ("2.1.0", True), ("3.0.0", False)], ids=["2.0", "2.1", "3.0"]
)
def test_row_a2_a_new_order_begins_with_update_id_0_if_the_version_requires_it(
    version: str,
    taken: bool,  # noqa: FBT001 - an example
) -> None:
    bench = Bench(rules=RULES[version])

    bench.send(order("n0", "n1", update=3))

    assert (bench.state.order_id == "o1") is taken
    assert bench.errors == ([] if taken else ["VALIDATION_FAILURE"])


@pytest.mark.clause("6.1.4.5", "6.6.1/request")
@pytest.mark.parametrize(
    ("version", "errors"), [("2.0.0", []), ("2.1.0", []), ("3.0.0", ["SAME_ORDER_UPDATE_ID"])]
)
def test_row_b3_different_content_with_the_same_update_id(version: str, errors: list[str]) -> None:
    bench = Bench(rules=RULES[version])
    bench.send(order("n0", "n1"))

    before = bench.state
    assert bench.send(order("n0", "n1")) == [ReportState()], "it is answered"
    assert bench.state == before
    bench.send(order("n0", "n2"))

    assert bench.errors == errors
    assert bench.nodes == ["n1"]


@pytest.mark.clause("6.1.4.5")
def test_row_b3_after_a_restart() -> None:
    bench = Bench(rules=RULES["3.0.0"])
    bench.send(order("n0", "n1"))
    again = Bench(
        memory=Memory.model_validate_json(bench.core.memory().model_dump_json()), rules=RULES["3.0.0"]
    )

    again.send(order("n0", "n1"))
    assert again.errors == []
    again.send(order("n0", "n2"))
    assert again.errors == ["SAME_ORDER_UPDATE_ID"]


@pytest.mark.clause("6.1.2")
@pytest.mark.parametrize(
    ("mended", "told"),
    [
        (0, "VALIDATION_FAILURE"),
        (1, "MOBILE_ROBOT_NOT_AVAILABLE"),
        (2, "INSUFFICIENT_MEMORY"),
        (3, "UNSUPPORTED_PARAMETER"),
        (4, "INVALID_ORDER_ACTION"),
    ],
)
def test_the_first_of_several_faults_is_reported(mended: int, told: str) -> None:
    bench = Bench(rules=RULES["3.0.0"], maximum_nodes=1000 if mended > 2 else 2)
    if mended < 2:
        bench.do(OperatingModeSwitched(OperatingMode.MANUAL))

    bench.send(
        order(
            "n5",
            "n6",
            "n7",
            order_id="o1" if mended else "",
            update=4,
            node_actions={"n5": [action("x", action_type="dance")]},
            edge_fields={} if mended > 3 else {"direction": "left"},
        )
    )

    assert bench.errors == [told]


@pytest.mark.clause("6.1.5", "6.1.4.2")
@pytest.mark.parametrize("version", ["2.1.0", "3.0.0"])
def test_a_corridor_is_refused_unless_the_settings_tolerate_it(version: str) -> None:
    wide = {"corridor": Corridor(left_width=1.0, right_width=1.0)}
    strict = Bench(rules=RULES[version])
    lenient = Bench(rules=RULES[version], tolerated_parameters=frozenset({"edges.corridor"}))

    strict.send(order("n0", "n1", edge_fields=wide))
    lenient.send(order("n0", "n1", edge_fields=wide))

    assert (strict.errors, strict.state.order_id) == (["UNSUPPORTED_PARAMETER"], "")
    assert (lenient.errors, lenient.state.order_id) == ([], "o1")


@pytest.mark.parametrize(
    ("theta", "map_id", "taken"), [(0.0, "attic", True), (None, "attic", False), (0.0, "b", False)]
)
def test_an_order_changes_maps_only_with_an_action_that_sets_the_position_there(
    theta: float | None, map_id: str, *, taken: bool
) -> None:
    text, number = ValueDataType.STRING, ValueDataType.NUMBER
    parameters = (
        Parameter("mapId", text),
        *(Parameter(key, number, required=False) for key in ("x", "theta")),
    )
    enable = ActionDeclaration("enableMap", (ActionScope.NODE,), parameters=parameters)
    bench = Bench(actions={**ACTIONS, "enableMap": enable})
    maps = (Map(map_id=each, map_version="1", map_status=MapStatus.ENABLED) for each in (MAP, "attic", "b"))
    bench.do(MapsReport(tuple(maps)))
    place: dict[str, Any] = {"x": 1.0} if theta is None else {"x": 1.0, "theta": theta}
    up = action("up", "HARD", "enableMap", mapId=map_id, **place)
    above = NodePosition(x=1.0, y=0.0, map_id="attic")
    bench.send(order("n0", "n1", "n2", positions={"n2": above}, node_actions={"n1": [up]}))
    assert bench.errors == ([] if taken else ["NO_ROUTE_TO_TARGET"])


@pytest.mark.parametrize("settings", [{}, {"tolerated_parameters": frozenset({"edges.maximumSpeed"})}])
def test_a_speed_of_0_is_refused_as_what_it_is(settings: dict[str, Any]) -> None:
    bench = Bench(**settings)
    message = order("n0", "n1")
    edges = (message.edges[0].model_copy(update={"maximum_speed": 0.0}),)

    bench.send(message.model_copy(update={"edges": edges}))

    (error,) = bench.state.errors
    assert error.error_type == "VALIDATION_FAILURE"
    assert "edge 'n0-n1' has the maximum speed 0" in str(error.error_description)
    named = {each.reference_key: each.reference_value for each in error.error_references}
    assert (named["edgeId"], named["parameter"]) == ("n0-n1", "edges.maximumSpeed")
