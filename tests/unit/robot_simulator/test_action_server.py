from __future__ import annotations

import sys

import pytest

from nena_robot_simulator.action_server import action_types
from nena_robot_simulator.goals import Action
from support.action_types import needs_action_types


@pytest.mark.ros
@needs_action_types
def test_each_action_has_its_type() -> None:
    assert [kind.__name__ for kind in action_types().values()] == [
        "NavigateToPose",
        "NavigateThroughPoses",
        "FollowPath",
    ]
    assert list(action_types()) == list(Action)


def test_without_the_package_there_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "nav2_msgs.action", None)
    assert action_types() == {}
