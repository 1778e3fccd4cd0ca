from __future__ import annotations

import json

import pytest

from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.actions.settings import OperationSettings
from nena_edge_agent.actions.timed_operation import TimedOperation
from nena_edge_agent.actions.wait import Wait
from nena_edge_agent.factsheet import make_factsheet
from nena_edge_agent.own_capabilities import make_capabilities
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.instant_actions import MESSAGE_LIMIT
from nena_edge_agent.protocol.zone_sets import ZONES_IN_A_SET
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.vda5050.action import BlockingType
from nena_shared.vda5050.codec import MAXIMUM_PAYLOAD
from nena_shared.vda5050.factsheet import ActionScope, Factsheet
from nena_shared.vda5050.v2_1 import CODEC
from support.robot_core import HEADER
from support.schemas import schema_problems


def factsheet(*operations: OperationSettings, **changes: object) -> Factsheet:
    settings = EdgeAgentSettings.model_validate({"operations": operations, **changes})
    registry = ActionRegistry([*(TimedOperation(each) for each in operations), Wait()])
    return make_factsheet(HEADER, settings, make_capabilities(settings, registry))


@pytest.mark.clause("6.10", "6.2.3")
def test_it_lists_exactly_the_actions_that_the_robot_does() -> None:
    lift = OperationSettings(
        action_type="lift",
        load="take",
        scopes=(ActionScope.NODE,),
        blocking_types=(BlockingType.HARD,),
        interruptible=False,
    )

    actions = {each.action_type: each for each in factsheet(lift).protocol_features.mobile_robot_actions}

    assert set(actions) == {
        "cancelOrder",
        "startPause",
        "stopPause",
        "stateRequest",
        "factsheetRequest",
        "initializePosition",
        "wait",
        "waitForTrigger",
        "lift",
    }
    assert actions["lift"].action_scopes == (ActionScope.NODE,)
    assert actions["lift"].blocking_types == (BlockingType.HARD,)
    assert not actions["lift"].cancel_allowed
    (duration,) = actions["wait"].action_parameters or ()
    assert (duration.key, duration.is_optional) == ("duration", False)


@pytest.mark.clause("6.10")
def test_it_follows_the_settings() -> None:
    sheet = factsheet(
        interval={"state_minimum": 0.5, "state_maximum": 10.0, "visualization": 0},
        description={"series_name": "Mule", "length": 1.0, "width": 0.5},
    )

    assert sheet.type_specification.series_name == "Mule"
    assert sheet.protocol_limits.timing.minimum_state_interval == 0.5
    assert sheet.protocol_limits.timing.visualization_interval is None
    assert sheet.protocol_limits.maximum_array_lengths.order_edges == 999
    (footprint,) = sheet.mobile_robot_geometry.envelopes2d or ()
    assert max(point.x for point in footprint.vertices) == 0.5
    assert sheet.load_specification.load_positions == ()


@pytest.mark.clause("6.10/parameters", "7.3/speed")
def test_a_limit_of_speed_is_offered_only_where_the_driver_keeps_it() -> None:
    offered = {
        driver: {each.parameter for each in factsheet(driver=driver).protocol_features.optional_parameters}
        for driver in ("loopback", "nav2")
    }

    assert offered["loopback"] - offered["nav2"] == {"order.edges.maximumSpeed"}
    assert "order.nodes.nodePosition.theta" in offered["nav2"]


@pytest.mark.clause("7.10/message")
def test_it_fits_the_official_schema() -> None:
    payload = CODEC.encode(factsheet(OperationSettings(action_type="pick", load="take")))

    assert not schema_problems("2.1.0", "factsheet", payload)
    assert json.loads(payload)["protocolFeatures"]["agvActions"]


@pytest.mark.clause("6.10/zones")
@pytest.mark.parametrize(
    ("version", "driver", "zones"),
    [
        ("2.1.0", "loopback", ()),
        ("3.0.0", "loopback", ("BLOCKED", "LINE_GUIDED", "RELEASE", "SPEED_LIMIT")),
        ("3.0.0", "nav2", ("BLOCKED", "LINE_GUIDED", "RELEASE")),
    ],
)
def test_it_lists_the_zones_that_the_robot_honours(version: str, driver: str, zones: tuple[str, ...]) -> None:
    assert factsheet(version=version, driver=driver).type_specification.supported_zones == zones


@pytest.mark.clause("7.1.2", "7.1.2/size", "6.2.1/limits")
def test_it_tells_the_limits_that_are_kept() -> None:
    limits = factsheet().protocol_limits

    assert limits.maximum_string_lengths.maximum_message_length == MAXIMUM_PAYLOAD
    assert limits.maximum_array_lengths.order_nodes == Capabilities(map_id="hall").maximum_nodes
    assert limits.maximum_array_lengths.instant_actions == MESSAGE_LIMIT
    assert limits.maximum_array_lengths.zone_set_zones == ZONES_IN_A_SET
