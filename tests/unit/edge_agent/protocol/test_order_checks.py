"""What every order is checked for, and what is told of a message with several faults."""

from __future__ import annotations

from dataclasses import replace

import pytest

from nena_edge_agent.protocol.events import MapsReport, OperatingModeSwitched
from nena_edge_agent.protocol.rules import RULES
from nena_shared.vda5050.action import BlockingType
from nena_shared.vda5050.order import Corridor
from nena_shared.vda5050.state import Map, MapStatus, OperatingMode
from support.robot_core import MAP, PRESS, Bench, action, order, position


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
def test_of_several_faults_the_first_is_told(mended: int, told: str) -> None:
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
def test_a_corridor_is_refused_unless_the_settings_pass_it_over(version: str) -> None:
    wide = {"corridor": Corridor(left_width=1.0, right_width=1.0)}
    strict = Bench(rules=RULES[version])
    lenient = Bench(rules=RULES[version], tolerated_parameters=frozenset({"edges.corridor"}))

    strict.send(order("n0", "n1", edge_fields=wide))
    lenient.send(order("n0", "n1", edge_fields=wide))

    assert (strict.errors, strict.state.order_id) == (["UNSUPPORTED_PARAMETER"], "")
    assert (lenient.errors, lenient.state.order_id) == ([], "o1")


@pytest.mark.clause("6.1.4.3")
def test_an_action_may_not_have_a_blocking_type_that_it_does_not_declare() -> None:
    bench = Bench(actions={"press": replace(PRESS, blocking_types=(BlockingType.HARD,))})

    bench.send(order("n0", node_actions={"n0": [action("x", "SOFT", "press")]}))

    assert bench.errors == ["INVALID_ORDER_ACTION"]
    assert "SOFT" in str(bench.state.errors[0].error_description)


@pytest.mark.clause("6.1.4.8")
def test_no_way_leads_from_map_to_map() -> None:
    bench = Bench()
    both = (Map(map_id=each, map_version="1", map_status=MapStatus.ENABLED) for each in (MAP, "attic"))
    bench.do(MapsReport(tuple(both)))
    upstairs = position(10.0).model_copy(update={"map_id": "attic"})

    bench.send(order("n0", "n1", positions={"n1": upstairs}))

    assert bench.errors == ["NO_ROUTE_TO_TARGET"]
