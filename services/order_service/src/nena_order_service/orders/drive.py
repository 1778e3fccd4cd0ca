"""A drive: the way of one vehicle to one destination, from the request of its route until it has ended."""

from __future__ import annotations

from enum import StrEnum
from functools import cached_property
from typing import Self

from nena_order_service.fleet.failures import OrderFailure
from nena_order_service.fleet.vda_order import VdaOrder, order_id, released_to
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.traffic.resources import ResourceSet
from nena_order_service.traffic.route_search import AllocatedRoute
from nena_shared.frozen_model import FrozenModel
from nena_shared.plant import BACKWARD_SUFFIX
from nena_shared.vda5050.topics import RobotKey


class DriveState(StrEnum):
    """How far a drive has come; one that has ended is deleted."""

    REQUESTED = "REQUESTED"
    """Its vehicle has requested a route."""
    GRANTED = "GRANTED"
    """Traffic control has granted a route; nothing of it is released yet."""
    SENT = "SENT"
    """Its VDA order is stored, and sent after the commit."""
    ACCEPTED = "ACCEPTED"
    """A state of the robot has echoed the VDA order."""


class Drive(FrozenModel):
    """One drive of one vehicle: a drive order of its transport order, or a relocation that makes room.

    ``vda_order`` is the whole plan, without nodes until a route is granted. ``released_to`` is the sequenceId
    of the last node of its base (None: all of it is base), reached with at most ``update_id`` updates.
    ``way`` lists the resources that it needs for each node after the first. A drive is stored once it is
    sent, because only then a robot may have it after a restart.
    """

    manufacturer: str
    serial_number: str
    order_number: int | None = None
    """The number of its transport order; None for a relocation."""
    drive_order_index: int | None = None
    state: DriveState = DriveState.REQUESTED
    retriable: bool = False
    """Whether the robot may retry its actions (VDA 5050 3.0, section 6.6.9)."""
    vda_order: VdaOrder
    released_to: int | None = None
    update_id: int = 0
    way: tuple[ResourceSet, ...] = ()
    partial: bool = False
    """Whether it ends before its destination, and its order is to continue from there."""
    cancelled: bool = False
    """Whether cancelOrder is to be sent."""
    given_up: OrderFailure | None = None
    """The failure for which it ends early; the failure policy decides once its robot has stopped."""

    @classmethod
    def to_current_destination(
        cls, order: TransportOrder, robot: RobotKey, *, retriable: bool = False
    ) -> Self:
        """Return the drive to the current destination of an order, for which a route is requested."""
        # 0025: each try is another VDA 5050 order, so that no orderId repeats.
        name = order_id(order.name, order.index, order.current.attempts)
        return cls(
            manufacturer=robot.manufacturer,
            serial_number=robot.serial_number,
            order_number=order.number,
            drive_order_index=order.index,
            retriable=retriable,
            vda_order=VdaOrder(order_id=name, nodes=(), edges=()),
        )

    @classmethod
    def making_room(cls, robot: RobotKey, vda_order: VdaOrder, way: tuple[ResourceSet, ...]) -> Self:
        """Return a relocation, which traffic control has decided."""
        return cls(
            manufacturer=robot.manufacturer,
            serial_number=robot.serial_number,
            state=DriveState.GRANTED,
            vda_order=vda_order,
            way=way,
        )

    @property
    def relocation(self) -> bool:
        """Whether it only makes room for others, and serves no order."""
        return self.order_number is None

    @property
    def order_id(self) -> str:
        """The orderId of its VDA order."""
        return self.vda_order.order_id

    @property
    def is_sent(self) -> bool:
        """Whether its robot may have its VDA order."""
        return self.state in (DriveState.SENT, DriveState.ACCEPTED)

    @property
    def accepted(self) -> bool:
        """Whether its robot is known to have its VDA order."""
        return self.state is DriveState.ACCEPTED

    @property
    def allocated(self) -> int:
        """How many sets of its way are allocated."""
        return len(self.way) if self.released_to is None else self.released_to // 2

    @property
    def all_released(self) -> bool:
        """Whether all of it was released to the robot."""
        return self.released_to is None

    @cached_property
    def robot(self) -> RobotKey:
        """The robot of its vehicle."""
        return RobotKey(self.manufacturer, self.serial_number)

    def changed(self, **changes: object) -> Self:
        """Return the drive with these changes."""
        return self.model_copy(update=changes)

    def granted(self, vda_order: VdaOrder, way: tuple[ResourceSet, ...]) -> Self:
        """Return the drive with the route that traffic control has granted."""
        return self.changed(state=DriveState.GRANTED, vda_order=vda_order, way=way)

    def requested_again(self) -> Self:
        """Return the drive without the route that was granted, because it requests another one."""
        empty = VdaOrder(order_id=self.order_id, nodes=(), edges=())
        return self.changed(state=DriveState.REQUESTED, vda_order=empty, way=())

    def released(self, route: AllocatedRoute) -> Self:
        """Return the drive with what its robot may drive as its base."""
        # VDA 5050 3.0, 6.1.1: nodes have even sequenceIds, so the n-th behind the first has 2n.
        end = None if route.all_released else 2 * route.released
        return self if end == self.released_to else self.changed(released_to=end)

    def updated(self, **changes: object) -> Self:
        """Return the drive with changes that are sent as an order update (section 6.1.2)."""
        return self.changed(**changes, update_id=self.update_id + 1)

    def ending_early(self, *, partial: bool) -> Self:
        """Return the drive with a VDA order that ends with its base; unchanged if it has no horizon."""
        if self.released_to is None:
            return self
        base = self.allocated
        vda_order = VdaOrder(
            order_id=self.order_id,
            nodes=self.vda_order.nodes[: base + 1],
            edges=self.vda_order.edges[:base],
        )
        return self.updated(vda_order=vda_order, released_to=None, way=self.way[:base], partial=partial)

    def ahead(self, reached: int) -> tuple[str, ...]:
        """Return the path and the point behind the ``reached``-th node; empty at the end."""
        if reached >= len(self.vda_order.edges):
            return ()
        path = self.vda_order.edges[reached].edge_id.removesuffix(BACKWARD_SUFFIX)
        return path, self.vda_order.nodes[reached + 1].node_id

    def as_released(self) -> VdaOrder:
        """Return the VDA order with its base as far as it is released."""
        return self.vda_order if self.released_to is None else released_to(self.vda_order, self.released_to)

    def document(self) -> str:
        """Return it as JSON for the store; ``model_validate_json`` reads it."""
        return self.model_dump_json(by_alias=True, exclude_none=True)
