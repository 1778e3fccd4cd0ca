"""Blocks: sets of points, paths and locations with a rule who may be in them at once."""

from collections.abc import Mapping
from enum import StrEnum

from pydantic import Field

from nena_shared.plant.record import PlantRecord


class BlockType(StrEnum):
    """The rule of a block."""

    SINGLE_VEHICLE_ONLY = "SINGLE_VEHICLE_ONLY"
    SAME_DIRECTION_ONLY = "SAME_DIRECTION_ONLY"


class Block(PlantRecord):
    """A block; its members are names of points, paths and locations."""

    name: str = Field(min_length=1)
    type: BlockType = BlockType.SINGLE_VEHICLE_ONLY
    members: tuple[str, ...] = ()
    properties: Mapping[str, str] = Field(default_factory=dict)
    color: str | None = None
