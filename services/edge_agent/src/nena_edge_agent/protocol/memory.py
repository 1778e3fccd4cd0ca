"""What a robot must still know after its agent was killed."""

from __future__ import annotations

from datetime import datetime

from pydantic import BaseModel, ConfigDict

from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.order import Edge, Node
from nena_shared.vda5050.request import RequestStatus
from nena_shared.vda5050.state import Load, OperatingMode
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.zone_set import ZoneSet

FORMAT = 1
"""Of a memory; one of another format is not understood."""


class ActionMemory(BaseModel):
    """An action and where it stood."""

    model_config = ConfigDict(frozen=True, from_attributes=True)

    action: Action
    scope: ActionScope
    sequence_id: int
    status: ActionStatus
    result: str | None


class ContentMemory(BaseModel):
    """Fingerprints of the order message that was accepted last."""

    model_config = ConfigDict(frozen=True, from_attributes=True)

    whole: str
    decision_node: str


class ProgressMemory(BaseModel):
    """The order and how far it was driven; the fields are those of ``OrderProgress``."""

    model_config = ConfigDict(frozen=True, from_attributes=True)

    order_id: str
    order_update_id: int
    last_node: Node | None
    last_node_id: str
    last_node_sequence_id: int
    on_last_node: bool
    edge_entered: bool
    cancelled: bool
    cleared: bool = False
    decision_point: tuple[str, int] | None
    content: ContentMemory | None = None
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]


class OrderHeaderMemory(BaseModel):
    """Header of the order message that was accepted last; the fields are those of ``OrderHeader``."""

    model_config = ConfigDict(frozen=True, from_attributes=True)

    header_id: int
    timestamp: datetime


class ZoneSetMemory(BaseModel):
    """A zone set, and whether it was enabled."""

    model_config = ConfigDict(frozen=True)

    zone_set: ZoneSet
    enabled: bool


class AccessMemory(BaseModel):
    """A request to enter a zone; the fields are those of ``AccessRequest``."""

    model_config = ConfigDict(frozen=True, from_attributes=True)

    zone_set_id: str
    zone_id: str
    request_id: str
    status: RequestStatus
    lease_expiry: datetime | None


class PoseMemory(BaseModel):
    """A place of the robot's map; the fields are those of ``Pose``."""

    model_config = ConfigDict(frozen=True, from_attributes=True)

    x: float
    y: float
    theta: float
    map_id: str


class OwnGoalsMemory(BaseModel):
    """Goals that navigation drives to; the fields are those of ``OwnGoals``."""

    model_config = ConfigDict(frozen=True, from_attributes=True)

    goal_ids: tuple[str, ...]
    pose: PoseMemory
    given: PoseMemory | None = None
    behind: str = ""


class Memory(BaseModel):
    """All that is durable of one robot."""

    model_config = ConfigDict(frozen=True)

    format: int
    progress: ProgressMemory
    actions: tuple[ActionMemory, ...]
    queue: tuple[str, ...]
    instant_actions: tuple[ActionMemory, ...]
    known_instant_ids: tuple[str, ...]
    clearing: bool
    paused: bool
    charging: bool
    loads: tuple[Load, ...]
    operating_mode: OperatingMode = OperatingMode.AUTOMATIC
    wanted_mode: OperatingMode | None = None
    zone_sets: tuple[ZoneSetMemory, ...] = ()
    zone_requests: tuple[AccessMemory, ...] = ()
    last_zone_request: int = 0
    own_goals: OwnGoalsMemory | None = None
    frame: str = ""
    """The frame of all coordinates; the field is that of ``Capabilities``."""
    ended_orders: tuple[str, ...] = ()
    """Digests of the orders that have ended; the field is that of ``OrderHistory``."""
    last_order_header: OrderHeaderMemory | None = None
    header_ids: tuple[tuple[Topic, int], ...] = ()
    """The headerId of each topic from which the next run of the program counts on."""
