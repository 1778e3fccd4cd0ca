"""What hosts may ask for at the MQTT door besides the creation of orders: commands and their answer."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from nena_shared.fleet_api.base import ObjectName, Request, Resource
from nena_shared.fleet_api.plant import PathStatus, StoredZoneSet, ZoneSetStatus
from nena_shared.fleet_api.requests import (
    DispatchRequest,
    HoldRequest,
    InstantActionAnswer,
    InstantActionRequest,
    IntegrationLevelRequest,
    OrderSequencePage,
    OrderTypesRequest,
    PathLockRequest,
    ReroutingRequest,
    ResumeRequest,
    WithdrawalRequest,
)
from nena_shared.fleet_api.transport_order import (
    AssignmentStatus,
    DeliveryStatus,
    OrderSequenceRequest,
    OrderSequenceStatus,
    Problem,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import ReroutingAnswer, VehicleStatus


class Command(Request):
    """Something that a host asks for."""

    request_id: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    """Comes back in the answer."""


class WithdrawCommand(Command, WithdrawalRequest):
    """Asks for the end of a transport order."""

    transport_order: ObjectName
    version: int | None = None
    """Only if it still has this version."""


class HoldCommand(Command, HoldRequest):
    """Lets a transport order wait until it is resumed."""

    transport_order: ObjectName
    version: int | None = None
    """Only if it still has this version."""


class ResumeCommand(Command, ResumeRequest):
    """Lets a held transport order go on."""

    transport_order: ObjectName
    version: int | None = None
    """Only if it still has this version."""


class DeliveryCommand(Command):
    """Asks how far a transport order has come on its way to its robot."""

    transport_order: ObjectName


class AssignmentCommand(Command):
    """Asks why the vehicles do not do a transport order."""

    transport_order: ObjectName


class DispatchCommand(Command, DispatchRequest):
    """Sends a vehicle somewhere."""

    vehicle: ObjectName


class InstantActionCommand(Command, InstantActionRequest):
    """Lets a vehicle do something at once."""

    vehicle: ObjectName


class IntegrationLevelCommand(Command, IntegrationLevelRequest):
    """Says how much a vehicle counts from now on."""

    vehicle: ObjectName


class OrderTypesCommand(Command, OrderTypesRequest):
    """Says which types of orders a vehicle accepts from now on."""

    vehicle: ObjectName


class RerouteCommand(Command, ReroutingRequest):
    """Asks for another way for the order that a vehicle works on."""

    vehicle: ObjectName


class PutZoneSetCommand(Command):
    """Puts a zone set of VDA 5050 3.0 here, for all robots that know zones."""

    zone_set: StoredZoneSet


class EnableZoneSetCommand(Command):
    """Has robots use a zone set, and no other one of its map."""

    zone_set_id: ObjectName


class DeleteZoneSetCommand(Command):
    """Has robots delete a zone set."""

    zone_set_id: ObjectName


class LockPathCommand(Command, PathLockRequest):
    """Locks or unlocks a path."""

    path: ObjectName


class CreateSequenceCommand(Command, OrderSequenceRequest):
    """Asks for an order sequence."""


class SequenceCommand(Command):
    """Asks how an order sequence stands."""

    order_sequence: ObjectName


class SequencesCommand(Command):
    """Asks for a list of order sequences, newest first."""

    finished: bool | None = None
    """None: finished or not."""
    limit: Annotated[int, Field(ge=1, le=1000)] = 100
    after: Annotated[str, Field(pattern=r"^[0-9]{1,18}$")] | None = None
    """What the answer before had as ``next``."""


class CompleteSequenceCommand(SequenceCommand):
    """Marks an order sequence complete: no more orders are added."""

    version: int | None = None
    """Only if it still has this version."""


class CommandAnswer(Resource):
    """Answer to a command: what has become of it, or a problem."""

    status: int
    """As over HTTP."""
    request_id: str | None = None
    transport_order: TransportOrderStatus | None = None
    order_sequence: OrderSequenceStatus | None = None
    order_sequences: OrderSequencePage | None = None
    delivery: DeliveryStatus | None = None
    assignment: AssignmentStatus | None = None
    instant_action: InstantActionAnswer | None = None
    path: PathStatus | None = None
    rerouting: ReroutingAnswer | None = None
    zone_set: ZoneSetStatus | None = None
    vehicle: VehicleStatus | None = None
    problem: Problem | None = None


COMMANDS: dict[str, type[Command]] = {
    "withdraw": WithdrawCommand,
    "hold": HoldCommand,
    "resume": ResumeCommand,
    "delivery": DeliveryCommand,
    "assignment": AssignmentCommand,
    "dispatch": DispatchCommand,
    "instantAction": InstantActionCommand,
    "lockPath": LockPathCommand,
    "reroute": RerouteCommand,
    "putZoneSet": PutZoneSetCommand,
    "enableZoneSet": EnableZoneSetCommand,
    "deleteZoneSet": DeleteZoneSetCommand,
    "integrationLevel": IntegrationLevelCommand,
    "acceptableOrderTypes": OrderTypesCommand,
    "createOrderSequence": CreateSequenceCommand,
    "orderSequence": SequenceCommand,
    "orderSequences": SequencesCommand,
    "completeOrderSequence": CompleteSequenceCommand,
}
"""The bodies by the commands' names."""
