"""ROS topics that the settings name end up in a recording, as a node has published them."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from support.edge_agent import status_of
from support.nav2_agent import Bench
from support.pausing import time_passes
from support.robot_core import action

pytestmark = [pytest.mark.ros, pytest.mark.broker]

WORDS = [f"wheel slips {number}" for number in range(20)]


async def test_topics_of_a_real_node_are_recorded_as_they_are(bench: Bench, tmp_path: Path) -> None:
    black_box = {
        "enabled": True,
        "topics": [
            {"topic": "wheels", "type": "std_msgs/msg/String"},
            {"topic": "arm", "type": "of_no_package/msg/Arm"},
        ],
    }
    async with bench.agent(black_box=black_box, upload={"folder": tmp_path / "outgoing"}) as fleet:
        publisher = await asyncio.to_thread(bench.ros.publisher, String, "/wheels")
        for each in WORDS:
            publisher.publish(String(data=each))
            await time_passes(0.05)
        fleet.instant(action("a-1", "NONE", "nena:fetchRecording"))
        await fleet.state(lambda state: status_of(state, "a-1") == "FINISHED")

    (file,) = (tmp_path / "outgoing").rglob("*-request.mcap")
    with file.open("rb") as stream:
        messages: Any = make_reader(stream).iter_messages(topics=["/wheels"])
        found = [(schema, channel, message) for schema, channel, message in messages]
    heard = [deserialize_message(message.data, String).data for _, _, message in found]
    assert heard[-1] == WORDS[-1]
    assert heard == WORDS[-len(heard) :]
    schema, channel, _ = found[0]
    assert (channel.message_encoding, schema.encoding) == ("cdr", "ros2msg")
    assert (schema.name, b"string data" in schema.data) == ("std_msgs/msg/String", True)
