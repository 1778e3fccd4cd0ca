"""What is stored of a mission, so that a restart can take it up again."""

from __future__ import annotations

from typing import Self

from pydantic import BaseModel, ConfigDict

from nena_order_service.fleet import Mission
from nena_shared.vda5050.topics import RobotKey


class MissionRecord(BaseModel):
    """A mission, whom it was sent to and whether the robot is known to have it.

    ``mission`` is the whole plan; ``released_to`` is the sequenceId of the last node that the robot was given
    for its base (None: all of it), by not more than ``update_id`` updates.
    """

    model_config = ConfigDict(frozen=True)

    manufacturer: str
    serial_number: str
    drive_order_index: int
    accepted: bool
    mission: Mission
    released_to: int | None = None
    update_id: int = 0

    @classmethod
    def of(cls, robot: RobotKey, mission: Mission, drive_order_index: int) -> Self:
        """Record a mission that is about to be sent."""
        return cls(
            manufacturer=robot.manufacturer,
            serial_number=robot.serial_number,
            drive_order_index=drive_order_index,
            accepted=False,
            mission=mission,
        )

    @property
    def robot(self) -> RobotKey:
        """Whom it was sent to."""
        return RobotKey(self.manufacturer, self.serial_number)

    def document(self) -> str:
        """Write it for the store; ``model_validate_json`` reads it."""
        return self.model_dump_json(by_alias=True, exclude_none=True)
