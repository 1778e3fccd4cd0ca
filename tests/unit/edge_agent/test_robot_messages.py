from __future__ import annotations

import pytest

from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.own_capabilities import make_capabilities
from nena_edge_agent.robot_messages import RobotMessages
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.clock import ManualClock
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.versions import codec_for
from nena_shared.vda5050.visualization import Visualization

ROBOT = RobotKey("NeNa", "robot1")


def messages(version: str = "2.1.0", first: int = 0) -> RobotMessages:
    settings = EdgeAgentSettings.model_validate({"version": version, "qos": 0})
    capabilities = make_capabilities(settings, ActionRegistry([]))
    reserved = ((Topic.CONNECTION, first),)
    return RobotMessages(settings, ROBOT, capabilities, clock=ManualClock(), reserved=reserved)


@pytest.mark.clause("6.5", "7.9")
@pytest.mark.parametrize("version", ["2.0.0", "2.1.0", "3.0.0"])
def test_whether_it_is_there_is_kept_by_the_broker_and_sent_with_care(version: str) -> None:
    found = messages(version).connection(ConnectionState.ONLINE)

    assert (found.retain, found.qos) == (True, 1)
    assert found.topic.endswith("/NeNa/robot1/connection")
    said = codec_for(version).decode(Connection, found.payload)
    assert (said.connection_state, said.version) == (ConnectionState.ONLINE, version)


@pytest.mark.clause("7.2/headerId")
def test_each_topic_counts_its_own_messages_from_where_an_earlier_run_may_have_been() -> None:
    made = messages(first=100)
    codec = codec_for("2.1.0")

    connections = [made.connection(ConnectionState.ONLINE).payload for _ in range(2)]
    sheet = made.factsheet()

    assert [codec.decode(Connection, each).header_id for each in connections] == [100, 101]
    assert codec.decode(Factsheet, sheet.payload).header_id == 0
    assert (sheet.retain, sheet.qos) == (True, 0)


def test_where_it_is_is_told_without_a_receipt_and_not_kept() -> None:
    made = messages()
    here = Visualization(**made.header(Topic.VISUALIZATION), reference_state_header_id=0)

    found = made.visualization(here)

    assert (found.qos, found.retain, found.keep) == (0, False, False)
    assert found.topic == made.topic(Topic.VISUALIZATION)
