"""Settings of recordings, as in every program that makes them."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from nena_shared.settings import SettingsGroup

MEBIBYTE = 1024 * 1024
LARGEST_FILE = 256 * MEBIBYTE
"""Maximum size of a recording, bytes."""


class RingSettings(SettingsGroup):
    """What the black box keeps in memory, and when it writes a file."""

    enabled: bool = Field(
        default=False, description="Keep the last minutes in memory, and write them to a file on a failure."
    )
    seconds: float = Field(300.0, gt=0, le=3600, description="Time that is kept, seconds.")
    memory: int = Field(
        16 * MEBIBYTE,
        ge=64 * 1024,
        le=LARGEST_FILE,
        description="Maximum memory, bytes; beyond it, the oldest entries are removed.",
    )
    delay: float = Field(
        5.0, ge=0, le=60, description="Time recorded after a failure before the file is written, seconds."
    )
    interval: float = Field(
        60.0,
        ge=0,
        le=3600,
        description="Minimum time between two files written on failures, seconds; requested ones are always "
        "written.",
    )


class OutgoingSettings(SettingsGroup):
    """Files that a program has written, and their transfer to the status aggregator."""

    enabled: bool = Field(
        default=False, description="Send recordings and log reports to the status aggregator over MQTT."
    )
    folder: Path = Field(
        Path("~/.local/state/nena/recordings"),
        description="Folder of the files, with a subfolder for each sender.",
    )
    keep: int = Field(
        20,
        ge=1,
        le=1000,
        description="Maximum number of files of each sender; beyond it, the oldest is removed.",
    )
    keep_bytes: int = Field(
        200 * MEBIBYTE,
        ge=MEBIBYTE,
        description="Maximum size of a robot's files, bytes; beyond it, the oldest is removed.",
    )
    rate: int = Field(500_000, ge=1000, description="Maximum rate of the transfer, bytes per second.")
