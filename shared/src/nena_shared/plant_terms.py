"""Terms of plant models that the API uses too; without the models, which take long to import."""

from enum import StrEnum
from typing import Final

MAX_BYTES: Final = 64 * 1024 * 1024
"""Limit of a plant model's file."""


class PointType(StrEnum):
    """What a vehicle may do at a point."""

    HALT_POSITION = "HALT_POSITION"
    PARK_POSITION = "PARK_POSITION"


class ExecutionTrigger(StrEnum):
    """When a peripheral operation starts. openTCS's files only have AFTER_ALLOCATION and AFTER_MOVEMENT."""

    IMMEDIATE = "IMMEDIATE"
    """When the vehicle's route is granted."""
    BEFORE_ALLOCATION = "BEFORE_ALLOCATION"
    """When the path is to be allocated next."""
    AFTER_ALLOCATION = "AFTER_ALLOCATION"
    """When the path is allocated, before it is released to the robot."""
    AFTER_MOVEMENT = "AFTER_MOVEMENT"
    """When the robot has reached the end of the path."""
