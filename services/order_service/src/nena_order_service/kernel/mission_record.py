"""What is stored of a mission, so that a restart can take it up again."""

from __future__ import annotations

from typing import Self

from pydantic import BaseModel, ConfigDict

from nena_order_service.fleet import Mission
from nena_order_service.fleet.mission_update import released_to
from nena_order_service.traffic.desk import Journey
from nena_order_service.traffic.resources import ResourceSet
from nena_shared.plant import BACKWARD_SUFFIX
from nena_shared.vda5050.topics import RobotKey


class MissionRecord(BaseModel):
    """A mission, whom it was sent to and whether the robot is known to have it.

    ``mission`` is the whole plan; ``released_to`` is the sequenceId of the last node that the robot was given
    for its base (None: all of it), by not more than ``update_id`` updates. ``way`` is what it needs of the
    plant for each node behind the first one. A mission of an order has the index of its drive order, one that
    makes room for others has none.
    """

    model_config = ConfigDict(frozen=True)

    manufacturer: str
    serial_number: str
    drive_order_index: int | None
    accepted: bool
    mission: Mission
    released_to: int | None = None
    update_id: int = 0
    way: tuple[ResourceSet, ...] = ()
    partial: bool = False
    """Whether it ends before its destination, and its order is to go on from there."""
    cancelled: bool = False
    """Whether the robot is to be told cancelOrder."""
    rerouting: bool = False
    """Whether it is cancelled so that its order goes on from where the robot stands then."""

    @classmethod
    def of(
        cls,
        robot: RobotKey,
        mission: Mission,
        drive_order_index: int | None,
        way: tuple[ResourceSet, ...] = (),
    ) -> Self:
        """Record a mission that is about to be sent."""
        return cls(
            manufacturer=robot.manufacturer,
            serial_number=robot.serial_number,
            drive_order_index=drive_order_index,
            accepted=False,
            mission=mission,
            way=way,
        )

    @property
    def evasion(self) -> bool:
        """Whether it makes room for others, and serves no order."""
        return self.drive_order_index is None

    @property
    def allocated(self) -> int:
        """How many sets of its way are allocated."""
        return len(self.way) if self.released_to is None else self.released_to // 2

    def ahead(self, reached: int) -> tuple[str, ...]:
        """Name the path and the point behind the ``reached``-th node; nothing at the end."""
        if reached >= len(self.mission.edges):
            return ()
        path = self.mission.edges[reached].edge_id.removesuffix(BACKWARD_SUFFIX)
        return path, self.mission.nodes[reached + 1].node_id

    def released(self, journey: Journey) -> Self:
        """Give the record with what is allocated for its base."""
        end = None if journey.all_allocated else 2 * journey.allocated
        return self.model_copy(update={"released_to": end})

    def updated(self, **changes: object) -> Self:
        """Give the record with changes that the robot is sent as an update."""
        return self.model_copy(update={**changes, "update_id": self.update_id + 1})

    @property
    def robot(self) -> RobotKey:
        """Whom it was sent to."""
        return RobotKey(self.manufacturer, self.serial_number)

    def as_released(self) -> Mission:
        """Give the mission with its base as far as it is released."""
        return self.mission if self.released_to is None else released_to(self.mission, self.released_to)

    @property
    def all_released(self) -> bool:
        """Whether the robot was given all of it."""
        return self.released_to is None

    def ending_early(self, *, partial: bool) -> Self:
        """Give the record of a mission that ends where its base does; one that is all base stays so."""
        if self.released_to is None:
            return self
        base = self.allocated
        mission = Mission(
            mission_id=self.mission.mission_id,
            nodes=self.mission.nodes[: base + 1],
            edges=self.mission.edges[:base],
        )
        return self.updated(mission=mission, released_to=None, way=self.way[:base], partial=partial)

    def document(self) -> str:
        """Write it for the store; ``model_validate_json`` reads it."""
        return self.model_dump_json(by_alias=True, exclude_none=True)
