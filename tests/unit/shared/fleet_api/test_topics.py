from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from paho.mqtt.client import topic_matches_sub

from nena_shared.fleet_api.topics import FleetTopics, PeripheralTopic, level_of
from nena_shared.vda5050.topics import RobotKey

LEVELS = st.text("abc-_1", min_size=1, max_size=8)
NAMES = st.one_of(st.text(min_size=1, max_size=12), st.text("%/+#.*> $ü\t0", min_size=1, max_size=8))
TOPICS = st.builds(FleetTopics, st.lists(LEVELS, min_size=1, max_size=3).map("/".join))


@given(TOPICS, LEVELS, LEVELS)
def test_each_topic_is_under_the_filter_of_its_kind_and_no_other(
    topics: FleetTopics, host: str, name: str
) -> None:
    filters = {
        topics.creation_requests: topics.creation_request(host),
        topics.commands: topics.command(host, name),
        topics.all_order_statuses: topics.order_status(name),
        topics.all_vehicle_statuses: topics.vehicle_status(name),
        topics.all_sequence_statuses: topics.sequence_status(name),
        topics.all_robot_maps: topics.robot_map(RobotKey(host, name)),
    }
    for sub, topic in filters.items():
        assert [each for each in filters if topic_matches_sub(each, topic)] == [sub]


@given(TOPICS, LEVELS, LEVELS)
def test_robot_is_parsed_from_its_map_topic(
    topics: FleetTopics, manufacturer: str, serial_number: str
) -> None:
    robot = RobotKey(manufacturer, serial_number)
    topic = topics.robot_map(robot)
    assert topics.robot_of_map(topic) == robot
    for other in (f"x{topic}", f"{topic}/x", f"{topics.prefix}/robots/{serial_number}/map", "", "map"):
        assert topics.robot_of_map(other) is None


@given(TOPICS, LEVELS, LEVELS)
def test_answers_are_no_requests(topics: FleetTopics, host: str, name: str) -> None:
    for answer in (topics.creation_answer(host), topics.command_answer(host, name)):
        assert not topic_matches_sub(topics.creation_requests, answer)
        assert not topic_matches_sub(topics.commands, answer)


@given(TOPICS, LEVELS, LEVELS)
def test_host_is_parsed_from_its_request_topic(topics: FleetTopics, host: str, name: str) -> None:
    assert topics.host_of(topics.creation_request(host)) == host
    assert topics.host_of(topics.command(host, name)) == host


@pytest.mark.parametrize(
    ("name", "level"),
    [
        ("WMS-2.1", "WMS-2%2E1"),
        ("Goods in", "Goods%20in"),
        ("$SYS", "%24SYS"),
        ("$$", "%24%24"),
        ("a$b", "a$b"),
        ("a/b", "a%2Fb"),
        ("+", "%2B"),
        ("#", "%23"),
        ("*", "%2A"),
        (">", "%3E"),
        ("50%", "50%25"),
        ("a%2Eb", "a%252Eb"),
        ("Tür", "Tür"),
        ("a\tb", "a%09b"),
        ("a\u00a0b", "a%C2%A0b"),
        ("WMS_7:3-a", "WMS_7:3-a"),
    ],
)
def test_a_name_is_a_level_that_every_broker_accepts(name: str, level: str) -> None:
    assert level_of(name) == level
    assert FleetTopics("a/b").order_status(name) == f"a/b/transportOrders/{level}/status"


@given(TOPICS, NAMES, NAMES)
def test_every_name_is_read_from_its_topics(topics: FleetTopics, name: str, other: str) -> None:
    own = (
        topics.order_status(name),
        topics.sequence_status(name),
        topics.vehicle_status(name),
        topics.peripheral(name, PeripheralTopic.STATE),
    )
    assert {topics.name_in(topic) for topic in own} == {name}
    assert len({len(topic.split("/")) for topic in own}) == 1
    robot = RobotKey(other, name)
    assert topics.robot_of_map(topics.robot_map(robot)) == robot
    assert topics.robot_of_chunk(topics.recording_chunks(robot)) == robot


@pytest.mark.parametrize("name", ["WMS-2.1", "Goods in", "$SYS", "a$b*", "Tür"])
def test_a_name_is_read_from_a_topic_of_an_older_version(name: str) -> None:
    topics = FleetTopics()
    assert topics.name_in(f"nena/v1/transportOrders/{name}/status") == name
    assert topics.robot_of_map(f"nena/v1/robots/ACME/{name}/map") == ("ACME", name)
