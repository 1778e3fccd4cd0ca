from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from paho.mqtt.client import topic_matches_sub

from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme

ROBOT = RobotKey("ACME", "0001")
LEVEL = st.text("abzAZ09_.:-", min_size=1, max_size=5)


@pytest.mark.clause("4.2")
def test_topic_of_a_robot() -> None:
    assert TopicScheme("uagv").of(ROBOT, Topic.INSTANT_ACTIONS) == "uagv/v2/ACME/0001/instantActions"


@pytest.mark.clause("4.2")
def test_filter_for_all_robots() -> None:
    assert TopicScheme("site/hall 1", "v3").for_all(Topic.STATE) == "site/hall 1/v3/+/+/state"


@pytest.mark.clause("4.2")
@pytest.mark.parametrize(
    "topic",
    [
        "uagv/v2/ACME/0001",
        "other/v2/ACME/0001/state",
        "uagv/v3/ACME/0001/state",
        "uagv/v2/ACME/0001/state/more",
        "hall/uagv/v2/ACME/0001/state",
        "state",
        "",
    ],
)
def test_topic_of_another_form_is_of_no_robot(topic: str) -> None:
    assert TopicScheme("uagv").robot_of(topic) is None


@pytest.mark.clause("4.2")
@given(
    levels=st.lists(LEVEL, min_size=1, max_size=3),
    version=st.sampled_from(["v2", "v3"]),
    manufacturer=LEVEL,
    serial_number=LEVEL,
    topic=st.sampled_from(Topic),
)
def test_robot_is_read_back_from_its_topic(
    levels: list[str], version: str, manufacturer: str, serial_number: str, topic: Topic
) -> None:
    scheme, robot = TopicScheme("/".join(levels), version), RobotKey(manufacturer, serial_number)

    assert scheme.robot_of(scheme.of(robot, topic)) == robot
    assert topic_matches_sub(scheme.for_all(topic), scheme.of(robot, topic))
