"""The kit's conversation with a robot: what the reason of a verdict quotes, and which messages show it."""

from __future__ import annotations

from datetime import UTC, datetime
from types import SimpleNamespace
from typing import cast

import pytest

from nena_conversations.kit.clause import ClauseFailedError
from nena_conversations.kit.honest_robot import ROBOT, HonestRobot
from nena_conversations.kit.session import RobotSession
from nena_conversations.recording import Entry
from nena_shared.mqtt import MqttLink
from nena_shared.vda5050.action import ActionState, ActionStatus
from nena_shared.vda5050.error import ErrorType, error
from nena_shared.vda5050.topics import Topic, TopicScheme
from nena_shared.vda5050.versions import codec_for

TOPICS = TopicScheme("uagv", "v2")


@pytest.fixture
def session() -> RobotSession:
    link = cast("MqttLink", SimpleNamespace(subscribe=lambda *_: None))
    return RobotSession(link, TOPICS, ROBOT, codec_for("2.1.0"))


def test_a_failed_action_is_explained_in_the_robots_words(session: RobotSession) -> None:
    robot = HonestRobot()
    robot.errors.append(error(ErrorType.ACTION_FAILED, "brake is locked"))
    session.heard.state = robot.state()
    ended = ActionState(
        action_id="1", action_type="startPause", action_status=ActionStatus.FAILED, action_result="no air"
    )
    with pytest.raises(
        ClauseFailedError, match=r"startPause ended FAILED \(no air\), not FINISHED"
    ) as failed:
        session.require_end(ended, ActionStatus.FINISHED)
    assert "(brake is locked)" in str(failed.value)
    session.require_end(ended, ActionStatus.FAILED)


def test_visualizations_are_not_among_the_messages_that_show_a_violation(session: RobotSession) -> None:
    topics = [Topic.STATE, *[Topic.VISUALIZATION] * 20]
    session.recording += [Entry(datetime.now(UTC), TOPICS.of(ROBOT, each), b"{}") for each in topics]
    assert [each.topic for each in session.shown(0)] == [TOPICS.of(ROBOT, Topic.STATE)]
