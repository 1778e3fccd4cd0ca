from __future__ import annotations

import pytest

from nena_edge_agent.driver.map_port import MapPose
from nena_edge_agent.driver.port import PositionInitialized
from nena_edge_agent.ros.commands import Report
from nena_edge_agent.ros.initial_position import InitialPosition, PublishInitialPose
from nena_edge_agent.ros.settings import LocalisationSettings

WANTED = MapPose(2.0, 1.0, 3.1, "hall")
ELSEWHERE = MapPose(9.0, 1.0, 3.1, "hall")
DONE = Report(PositionInitialized(succeeded=True, description=""))


@pytest.fixture
def initial_position() -> InitialPosition:
    return InitialPosition(LocalisationSettings(initial_wait=1.0, initial_attempts=3))


def test_is_given_and_confirmed_by_a_pose_near_it(initial_position: InitialPosition) -> None:
    assert initial_position.ask(WANTED, 0.0) == [PublishInitialPose(WANTED)]
    assert initial_position.on_pose(ELSEWHERE) == []
    assert initial_position.on_pose(MapPose(2.3, 1.2, -3.1, "hall")) == [DONE]
    assert not initial_position.busy


def test_wrong_heading_confirms_nothing(initial_position: InitialPosition) -> None:
    initial_position.ask(WANTED, 0.0)
    assert initial_position.on_pose(MapPose(2.0, 1.0, 0.0, "hall")) == []
    assert initial_position.busy


def test_is_given_again_and_then_given_up(initial_position: InitialPosition) -> None:
    initial_position.ask(WANTED, 0.0)
    assert initial_position.tick(0.9) == []
    assert initial_position.tick(1.0) == [PublishInitialPose(WANTED)]
    assert initial_position.tick(1.5) == []
    assert initial_position.tick(2.0) == [PublishInitialPose(WANTED)]
    (answer,) = initial_position.tick(3.0)
    assert isinstance(answer, Report)
    assert isinstance(answer.event, PositionInitialized)
    assert not answer.event.succeeded
    assert "after 3 initial positions" in answer.event.description
    assert initial_position.tick(9.0) == []


def test_failure_says_where_the_localisation_stays(initial_position: InitialPosition) -> None:
    initial_position.ask(WANTED, 0.0)
    initial_position.on_pose(ELSEWHERE)
    for now in (1.0, 2.0):
        initial_position.tick(now)
    (answer,) = initial_position.tick(3.0)
    assert "stays at x 9.00 m" in str(answer)


def test_poses_from_before_say_nothing(initial_position: InitialPosition) -> None:
    assert initial_position.on_pose(WANTED) == []
    initial_position.ask(WANTED, 0.0)
    assert initial_position.busy


def test_newer_position_replaces_the_older_one(initial_position: InitialPosition) -> None:
    initial_position.ask(ELSEWHERE, 0.0)
    initial_position.ask(WANTED, 0.5)
    assert initial_position.on_pose(ELSEWHERE) == []
    assert initial_position.on_pose(WANTED) == [DONE]
