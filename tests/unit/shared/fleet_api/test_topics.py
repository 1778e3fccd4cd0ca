from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from paho.mqtt.client import topic_matches_sub

from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.vda5050.topics import RobotKey

LEVELS = st.text("abc-_1", min_size=1, max_size=8)
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
