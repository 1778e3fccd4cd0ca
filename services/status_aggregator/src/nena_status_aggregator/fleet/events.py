"""What happens to robots and orders, one entry for each thing worth remembering."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum
from typing import NamedTuple

from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.brief.state import ActionBrief, ErrorBrief, StateBrief
from nena_status_aggregator.fleet.view_builder import LIST_LIMIT, is_active, short


class Code(StrEnum):
    """The kinds of happenings: a bounded list, for filters, translations and counters."""

    CONNECTION = "connection"
    """A robot's connection state is another one; `state`, `before`."""
    CONDITION = "condition"
    """A robot came into a condition, or has another reason to stand; `condition`, `before`, `reason`."""
    OPERATING_MODE = "operatingMode"
    """`mode`, `before`."""
    ORDER_TAKEN = "orderTaken"
    """A robot shows a new order; `orderId`, `orderUpdateId`."""
    ORDER_UPDATED = "orderUpdated"
    """A robot shows an update of its order; `orderId`, `orderUpdateId`."""
    ORDER_ENDED = "orderEnded"
    """A robot has nothing of its order left to do; `orderId`, `outcome`: see :class:`Outcome`."""
    NODE_REACHED = "nodeReached"
    """`nodeId`, `sequenceId`."""
    ACTION_ENDED = "actionEnded"
    """`actionId`, `actionType`, `status`: FINISHED or FAILED, `result`."""
    ERROR_RAISED = "errorRaised"
    """`errorType`, `errorLevel`, `description`."""
    ERROR_CLEARED = "errorCleared"
    """`errorType`, `errorLevel`."""
    CHARGING = "charging"
    """A robot has begun or ended to charge; `charging`, `charge` in percent."""
    LOADS = "loads"
    """A robot carries another number of loads; `loads`, `before`."""
    MAP = "map"
    """A robot is on another map; `mapId`, `before`."""
    POSITION = "position"
    """A robot has moved on by a set way; `x`, `y` in m, `theta` in rad, `mapId`."""
    ROBOT_FORGOTTEN = "robotForgotten"
    """A silent robot made room for a new one."""
    TRANSPORT_ORDER = "transportOrder"
    """A transport order is in another state, or waits for something else; `state`, `before`."""
    LINK = "link"
    """The aggregator's link to the broker stands or is lost; `connected`."""
    HISTORY_GAP = "historyGap"
    """Happenings that were not written; `dropped`."""


class Outcome(StrEnum):
    """How an order of a robot ended, as far as its states show."""

    COMPLETED = "completed"
    """The robot reached the last node, and no action failed."""
    ABANDONED = "abandoned"
    """It was cancelled or failed before."""
    UNSEEN = "unseen"
    """Another order followed before a state showed the end."""


Values = dict[str, str | float | None]


@dataclass(frozen=True, slots=True)
class Happening:
    """One thing that happened; the times are those of the aggregator."""

    time: datetime
    code: Code
    text: str
    """In words."""
    robot: str | None = None
    """Manufacturer and serial number."""
    order: str | None = None
    """Name of the transport order, else the VDA 5050 order that the robot holds."""
    values: Values = field(default_factory=dict)


class Change(NamedTuple):
    """What happened, in words and values."""

    code: Code
    text: str
    values: Values


def changes(before: StateBrief | None, now: StateBrief) -> Iterator[Change]:
    """Tell what changed; of a first state only its errors, for nobody knows how old the rest is."""
    yield from _errors(before.errors if before else (), now.errors)
    if before is None:
        return
    yield from _order(before, now)
    yield from _actions(before, now)
    if before.operating_mode is not now.operating_mode:
        mode, old = now.operating_mode.value, before.operating_mode.value
        yield Change(Code.OPERATING_MODE, f"Operating mode {mode}.", {"mode": mode, "before": old})
    yield from _body(before, now)


def _errors(before: tuple[ErrorBrief, ...], now: tuple[ErrorBrief, ...]) -> Iterator[Change]:
    if not before and not now:
        return
    old, new = _by_identity(before), _by_identity(now)
    for entry in (new[key] for key in new.keys() - old.keys()):
        text = short(entry.error_description) or "No description."
        values = _error_values(entry)
        yield Change(Code.ERROR_RAISED, f"{values['errorType']}: {text}", {**values, "description": text})
    for entry in (old[key] for key in old.keys() - new.keys()):
        values = _error_values(entry)
        yield Change(Code.ERROR_CLEARED, f"No longer: {values['errorType']}.", values)


def _by_identity(
    errors: tuple[ErrorBrief, ...],
) -> dict[tuple[str, *tuple[str, ...]], ErrorBrief]:
    return {(each.error_type, *_references(each)): each for each in errors[:LIST_LIMIT]}


def _references(error: ErrorBrief) -> Iterator[str]:
    for each in error.error_references:
        yield from (each.reference_key, each.reference_value)


def _error_values(entry: ErrorBrief) -> Values:
    return {"errorType": short(entry.error_type), "errorLevel": entry.error_level.value}


def _order(before: StateBrief, now: StateBrief) -> Iterator[Change]:
    another = now.order_id != before.order_id
    if is_active(before) and (another or not is_active(now)):
        outcome = _outcome(before, now)
        text = f"Order {before.order_id} {outcome.value}."
        yield Change(Code.ORDER_ENDED, text, {"orderId": before.order_id, "outcome": outcome.value})
    values: Values = {"orderId": now.order_id, "orderUpdateId": now.order_update_id}
    if another and now.order_id:
        yield Change(Code.ORDER_TAKEN, f"Took order {now.order_id}.", values)
    elif not another and now.order_update_id != before.order_update_id:
        yield Change(Code.ORDER_UPDATED, f"Took update {now.order_update_id} of its order.", values)
    reached = (now.last_node_id, now.last_node_sequence_id)
    if now.last_node_id and (another or reached != (before.last_node_id, before.last_node_sequence_id)):
        yield from _node(before, now)


def _node(before: StateBrief, now: StateBrief) -> Iterator[Change]:
    """Tell of a node, unless it is only the first one of a new order, where the robot stands already."""
    if now.last_node_id != before.last_node_id or now.order_id == before.order_id:
        values: Values = {"nodeId": now.last_node_id, "sequenceId": now.last_node_sequence_id}
        yield Change(Code.NODE_REACHED, f"Reached {now.last_node_id}.", values)


def _outcome(before: StateBrief, now: StateBrief) -> Outcome:
    if now.order_id != before.order_id:
        return Outcome.UNSEEN
    last = before.node_states[-1].sequence_id if before.node_states else 0
    failed = any(each.action_status is ActionStatus.FAILED for each in now.action_states)
    completed = now.last_node_sequence_id >= last and not failed
    return Outcome.COMPLETED if completed else Outcome.ABANDONED


def _actions(before: StateBrief, now: StateBrief) -> Iterator[Change]:
    if not (now.action_states or now.instant_action_states):
        return
    known = {
        each.action_id: each.action_status for each in (*before.action_states, *before.instant_action_states)
    }
    for action in (*now.action_states[:LIST_LIMIT], *now.instant_action_states[:LIST_LIMIT]):
        old = known.get(action.action_id)
        if action.action_status.ended and action.action_status is not old:
            yield _action_ended(action)


def _action_ended(action: ActionBrief) -> Change:
    status, name = action.action_status.value, action.action_type or action.action_id
    result = short(action.action_result)
    values: Values = {
        "actionId": action.action_id,
        "actionType": action.action_type,
        "status": status,
        "result": result,
    }
    return Change(Code.ACTION_ENDED, f"Action {name}: {status}." + (f" {result}" if result else ""), values)


def _body(before: StateBrief, now: StateBrief) -> Iterator[Change]:
    power = now.power_supply
    if power.charging is not before.power_supply.charging:
        text = "Began to charge." if power.charging else "Ended charging."
        values: Values = {"charging": power.charging, "charge": power.state_of_charge}
        yield Change(Code.CHARGING, text, values)
    loads, loads_before = len(now.loads or ()), len(before.loads or ())
    if loads != loads_before:
        yield Change(Code.LOADS, f"Carries {loads} loads.", {"loads": loads, "before": loads_before})
    here, there = now.mobile_robot_position, before.mobile_robot_position
    if here and there and here.map_id != there.map_id:
        yield Change(Code.MAP, f"Is on map {here.map_id}.", {"mapId": here.map_id, "before": there.map_id})
