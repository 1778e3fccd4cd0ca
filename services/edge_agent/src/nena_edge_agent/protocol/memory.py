"""The journal's record of a robot: its format, and the conversion to and from the robot's state."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from datetime import datetime

from pydantic import BaseModel, ConfigDict

from nena_edge_agent.driver.port import OwnGoals
from nena_edge_agent.protocol.action_states import ActionRecord
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.order_progress import (
    OrderFingerprints,
    OrderHeader,
    OrderHistory,
    OrderProgress,
    PathOf,
)
from nena_edge_agent.protocol.robot_state import PowerPhase, RobotState
from nena_edge_agent.protocol.zone_sets import AccessRequest, ZoneRequests
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.order import Edge, Node
from nena_shared.vda5050.state import Load, OperatingMode
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.zone_set import ZoneSet

FORMAT = 1
"""Format version of the record; records of other versions are refused."""


class ProgressMemory(BaseModel):
    """The order and its progress; the fields are those of ``OrderProgress``."""

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
    content: OrderFingerprints | None = None
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]


class ZoneSetMemory(BaseModel):
    """A zone set, and whether it was enabled."""

    model_config = ConfigDict(frozen=True)

    zone_set: ZoneSet
    enabled: bool


class Memory(BaseModel):
    """The journal's record of one robot."""

    model_config = ConfigDict(frozen=True)

    format: int
    progress: ProgressMemory
    actions: tuple[ActionRecord, ...]
    queue: tuple[str, ...]
    instant_actions: tuple[ActionRecord, ...]
    known_instant_ids: tuple[str, ...]
    clearing: bool
    paused: bool
    charging: bool
    loads: tuple[Load, ...]
    operating_mode: OperatingMode = OperatingMode.AUTOMATIC
    wanted_mode: OperatingMode | None = None
    zone_sets: tuple[ZoneSetMemory, ...] = ()
    zone_requests: tuple[AccessRequest, ...] = ()
    last_zone_request: int = 0
    own_goals: OwnGoals | None = None
    frame: str = ""
    """The frame of all coordinates, as in ``Capabilities``."""
    ended_orders: tuple[str, ...] = ()
    """Digests of ended orders, as in ``OrderHistory``."""
    last_order_header: OrderHeader | None = None
    power: PowerPhase = PowerPhase.AWAKE
    wake_up_at: datetime | None = None
    header_ids: tuple[tuple[Topic, int], ...] = ()
    """The first headerId of each topic for the next run of the program."""


def memory_of(robot: RobotState) -> Memory:
    """Return the record of ``robot``: the data that must survive the end of the process."""
    return Memory(
        format=FORMAT,
        progress=ProgressMemory.model_validate(robot.progress),
        actions=tuple(map(_kept, robot.actions)),
        queue=tuple(robot.queue),
        instant_actions=tuple(map(_kept, robot.instant_actions)),
        known_instant_ids=tuple(robot.known_instant_ids),
        clearing=robot.clearing,
        paused=robot.paused,
        charging=robot.charging,
        loads=robot.loads,
        operating_mode=robot.operating_mode,
        wanted_mode=robot.wanted_mode,
        zone_sets=tuple(
            ZoneSetMemory(zone_set=zone_set, enabled=on) for zone_set, on in robot.zone_sets.held
        ),
        zone_requests=robot.zone_requests.requests,
        last_zone_request=robot.zone_requests.last_number,
        own_goals=robot.goal.own,
        ended_orders=robot.history.ended,
        last_order_header=robot.history.last_header,
        power=robot.power,
        wake_up_at=robot.wake_up_at,
        header_ids=robot.header_ids,
        frame=robot.capabilities.frame,
    )


def restore_robot(memory: Memory, capabilities: Capabilities, path_of: PathOf | None = None) -> RobotState:
    """Return the state of a robot from its record; ``path_of`` as in ``OrderProgress``."""
    progress = OrderProgress(capabilities.rules, path_of)
    for name in ProgressMemory.model_fields:
        setattr(progress, name, getattr(memory.progress, name))
    progress.nodes, progress.edges = deque(memory.progress.nodes), deque(memory.progress.edges)
    progress.describe_rest()
    robot = RobotState(
        capabilities,
        history=OrderHistory(memory.ended_orders, memory.last_order_header),
        progress=progress,
        known_instant_ids=dict.fromkeys(memory.known_instant_ids),
        clearing=memory.clearing,
        paused=memory.paused,
        hold_applied=memory.paused,
        charging=memory.charging,
        loads=memory.loads,
        operating_mode=memory.operating_mode,
        wanted_mode=memory.wanted_mode,
        # A robot that runs again has been shut down and started.
        power=PowerPhase.AWAKE if memory.power is PowerPhase.SHUTTING_DOWN else memory.power,
        wake_up_at=memory.wake_up_at,
        header_ids=memory.header_ids,
        zone_requests=ZoneRequests(memory.zone_requests, memory.last_zone_request),
    )
    if memory.own_goals:
        robot.goal.restore(memory.own_goals)
    robot.zone_sets.restore(tuple((held.zone_set, held.enabled) for held in memory.zone_sets))
    robot.actions.add(map(replace, memory.actions))
    robot.instant_actions.add(map(replace, memory.instant_actions))
    queued = (robot.actions.get(action_id) for action_id in memory.queue)
    robot.queue.append(record.action for record in queued if record)
    robot.instant_queue.append(
        record.action
        for record in robot.instant_actions
        if not record.status.ended
        # one that waits was in the queue, whatever the settings say now
        and (record.status is ActionStatus.WAITING or robot.holds_for(record.action))
    )
    return robot


def _kept(record: ActionRecord) -> ActionRecord:
    """Return a copy of an action to store; an ended one needs no parameters."""
    ended = record.status.ended and record.action.action_parameters
    action = record.action.model_copy(update={"action_parameters": ()}) if ended else record.action
    return replace(record, action=action)
