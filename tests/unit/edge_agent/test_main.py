from __future__ import annotations

import pytest

from nena_edge_agent.loopback.control import SimulationControl
from nena_edge_agent.program import make_registry
from nena_edge_agent.robot_link import RobotLink
from nena_edge_agent.settings import EdgeAgentSettings
from support.edge_agent import make_robot

REHEARSAL = {"waitUninterrupted", "failAlways", "failOnce", "needParameter"}


@pytest.mark.clause("6.10")
@pytest.mark.parametrize(
    ("driver", "rehearsal", "there"),
    [("loopback", True, True), ("loopback", False, False), ("nav2", True, False)],
)
def test_simulated_actions_require_a_loopback_robot_with_the_setting(
    *, driver: str, rehearsal: bool, there: bool
) -> None:
    settings = EdgeAgentSettings.model_validate({"driver": driver, "loopback": {"rehearsal": rehearsal}})

    declared = set(make_registry(settings, SimulationControl(RobotLink().cut), make_robot()).declarations)

    assert {"wait", "pick", "drop"} <= declared
    assert declared & REHEARSAL == (REHEARSAL if there else set())
