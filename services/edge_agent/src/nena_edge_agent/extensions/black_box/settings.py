"""Settings of the black box."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from nena_shared.extensions.black_box.settings import RingSettings
from nena_shared.settings import SettingsGroup

RosTypeName = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*/msg/[A-Z][A-Za-z0-9]*$")]


class RecordedTopic(SettingsGroup):
    """A ROS topic to record."""

    topic: str = Field(
        min_length=1, max_length=200, description="Name of the topic; relative to the namespace."
    )
    type: RosTypeName = Field(description="Message type, such as sensor_msgs/msg/Imu.")


class BlackBoxSettings(RingSettings):
    """The black box: messages, journal, log and ROS topics of the last minutes."""

    topics: tuple[RecordedTopic, ...] = Field(
        (),
        max_length=50,
        description="ROS topics to record: [[black_box.topics]] tables with topic and type.",
    )
