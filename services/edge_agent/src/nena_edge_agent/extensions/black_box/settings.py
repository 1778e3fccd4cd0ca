"""Settings of the black box."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from nena_shared.extensions.black_box.settings import OutgoingSettings, RingSettings
from nena_shared.settings import SettingsGroup, TopLevelSettings

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


class LogReportSettings(SettingsGroup):
    """Log reports requested by fleet control."""

    folder: Path = Field(Path("~/.local/state/nena/log_reports"), description="Folder of the reports.")
    keep: int = Field(
        20, ge=1, le=1000, description="Maximum number of reports; beyond, the oldest is removed."
    )


class RecordingSettings(TopLevelSettings):
    """What is recorded, and where the files go."""

    black_box: BlackBoxSettings = Field(
        default_factory=BlackBoxSettings,
        description="Black box: the last minutes as an MCAP file; needs the extra `blackbox`.",
    )
    log_report: LogReportSettings = Field(
        default_factory=LogReportSettings, description="The action logReport."
    )
    upload: OutgoingSettings = Field(
        default_factory=OutgoingSettings,
        description="Files of the black box and log reports, and their transfer to the status aggregator.",
    )
