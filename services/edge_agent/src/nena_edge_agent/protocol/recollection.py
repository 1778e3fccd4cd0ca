"""Between the parts of a running robot and what is kept of them on disk."""

from __future__ import annotations

from nena_edge_agent.driver.port import OwnGoals, Pose
from nena_edge_agent.protocol.action_states import ActionRecord
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.memory import (
    FORMAT,
    AccessMemory,
    ActionMemory,
    Memory,
    OrderHeaderMemory,
    OwnGoalsMemory,
    PoseMemory,
    ProgressMemory,
    ZoneSetMemory,
)
from nena_edge_agent.protocol.order_progress import OrderHeader, OrderHistory, OrderProgress
from nena_edge_agent.protocol.parts import RobotParts
from nena_edge_agent.protocol.zone_sets import AccessRequest, ZoneAccess


def recall(parts: RobotParts) -> Memory:
    """Give what is durable of ``parts``."""
    last_header = parts.history.last_header
    return Memory(
        format=FORMAT,
        progress=ProgressMemory.model_validate(parts.progress),
        actions=tuple(_kept(record) for record in parts.actions),
        queue=tuple(parts.queue),
        instant_actions=tuple(_kept(record) for record in parts.instants),
        known_instant_ids=tuple(parts.known_instant_ids),
        clearing=parts.clearing,
        paused=parts.paused,
        charging=parts.charging,
        loads=parts.loads,
        operating_mode=parts.operating_mode,
        wanted_mode=parts.wanted_mode,
        zone_sets=tuple(ZoneSetMemory(zone_set=one, enabled=on) for one, on in parts.zone_sets.held),
        zone_requests=tuple(AccessMemory.model_validate(each) for each in parts.zone_access.requests),
        last_zone_request=parts.zone_access.last_number,
        own_goals=OwnGoalsMemory.model_validate(parts.goal.own) if parts.goal.own else None,
        ended_orders=parts.history.ended,
        last_order_header=OrderHeaderMemory.model_validate(last_header) if last_header else None,
        header_ids=parts.header_ids,
        frame=parts.capabilities.frame,
    )


def recollect(memory: Memory, capabilities: Capabilities) -> RobotParts:
    """Make the parts of a robot again from what was kept."""
    header = memory.last_order_header
    parts = RobotParts(
        capabilities,
        history=OrderHistory(
            memory.ended_orders, OrderHeader(header.header_id, header.timestamp) if header else None
        ),
        progress=OrderProgress.restored(memory.progress),
        known_instant_ids=dict.fromkeys(memory.known_instant_ids),
        clearing=memory.clearing,
        paused=memory.paused,
        holding=memory.paused,
        charging=memory.charging,
        loads=memory.loads,
        operating_mode=memory.operating_mode,
        wanted_mode=memory.wanted_mode,
        header_ids=memory.header_ids,
        zone_access=ZoneAccess(
            (AccessRequest(**dict(each)) for each in memory.zone_requests), memory.last_zone_request
        ),
    )
    if own := memory.own_goals:
        given = _pose(own.given) if own.given else None
        parts.goal.restore(OwnGoals(own.goal_ids, _pose(own.pose), given, own.behind))
    parts.zone_sets.restore(tuple((each.zone_set, each.enabled) for each in memory.zone_sets))
    parts.actions.add(_record(kept) for kept in memory.actions)
    parts.instants.add(_record(kept) for kept in memory.instant_actions)
    queued = (parts.actions.get(action_id) for action_id in memory.queue)
    parts.queue.append(record.action for record in queued if record)
    return parts


def _pose(kept: PoseMemory) -> Pose:
    return Pose(kept.x, kept.y, kept.theta, kept.map_id)


def _kept(record: ActionRecord) -> ActionMemory:
    """Give what is kept of an action; one that has ended is only shown, and needs its parameters no more."""
    action = record.action
    if record.status.ended and action.action_parameters:
        action = action.model_copy(update={"action_parameters": ()})
    return ActionMemory(
        action=action,
        scope=record.scope,
        sequence_id=record.sequence_id,
        status=record.status,
        result=record.result,
    )


def _record(kept: ActionMemory) -> ActionRecord:
    return ActionRecord(kept.action, kept.scope, kept.sequence_id, kept.status, kept.result)
