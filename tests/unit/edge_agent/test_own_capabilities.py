from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.actions.wait import Wait
from nena_edge_agent.own_capabilities import braking_distance, make_capabilities
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.rules import RULES
from nena_edge_agent.settings import DescriptionSettings, EdgeAgentSettings

SPEEDS = st.floats(0.0, 5.0)


def capabilities(**changes: object) -> Capabilities:
    return make_capabilities(EdgeAgentSettings.model_validate(changes), ActionRegistry([Wait()]))


@given(SPEEDS, st.floats(0.1, 5.0))
def test_the_way_to_a_stop_grows_with_the_speed_and_shrinks_with_the_brakes(
    speed: float, brakes: float
) -> None:
    here = braking_distance(DescriptionSettings(maximum_speed=speed, maximum_deceleration=brakes))
    better = braking_distance(DescriptionSettings(maximum_speed=speed, maximum_deceleration=2 * brakes))
    faster = braking_distance(DescriptionSettings(maximum_speed=speed + 0.5, maximum_deceleration=brakes))

    assert speed * 0.5 <= better <= here < faster


def test_a_robot_that_tells_no_deceleration_needs_the_time_to_begin() -> None:
    assert braking_distance(DescriptionSettings(maximum_speed=2.0, maximum_deceleration=0.0)) == 1.0


def test_it_stops_in_the_way_that_its_data_say() -> None:
    assert braking_distance(DescriptionSettings(maximum_speed=2.0, maximum_deceleration=1.0)) == 3.0


@pytest.mark.parametrize("version", ["2.0.0", "2.1.0", "3.0.0"])
def test_it_goes_by_the_rules_of_its_version(version: str) -> None:
    assert capabilities(version=version).rules is RULES[version]


@pytest.mark.parametrize(("driver", "limits"), [("loopback", True), ("nav2", False)])
def test_only_the_loopback_robot_takes_limits_of_speed(driver: str, *, limits: bool) -> None:
    assert capabilities(driver=driver).limits_speed is limits


def test_it_has_its_own_actions_beside_those_of_the_standard() -> None:
    types = set(capabilities().actions)
    assert {"wait", "cancelOrder", "startPause"} <= types
