"""Event types, and the events between two states of a robot."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum
from typing import NamedTuple

from nena_shared.vda5050.action import ActionState, ActionStatus
from nena_shared.vda5050.error import ErrorEntry
from nena_shared.vda5050.state import State
from nena_status_aggregator.fleet.view_builder import LIST_LIMIT, is_active, short
from nena_status_aggregator.fleet.views import CodedReasonView


class Code(StrEnum):
    """Kinds of events; bounded, for filters, translations and counters."""

    CONNECTION = "connection"
    """The connection state changed; `state`, `before`."""
    CONDITION = "condition"
    """The condition or the reason for not moving changed; `condition`, `before`, `reason`, and its values."""
    OPERATING_MODE = "operatingMode"
    """The operating mode changed; `mode`, `before`."""
    ORDER_TAKEN = "orderTaken"
    """The robot accepted an order; `orderId`, `orderUpdateId`."""
    ORDER_UPDATED = "orderUpdated"
    """The robot accepted an order update; `orderId`, `orderUpdateId`."""
    ORDER_ENDED = "orderEnded"
    """The robot's order ended; `orderId`, `outcome` (:class:`Outcome`); `distance` since its previous order
    ended, and the part without a load, `emptyDistance`, m (null: loads not reported)."""
    NODE_REACHED = "nodeReached"
    """The robot reached a node; `nodeId`, `sequenceId`."""
    ACTION_ENDED = "actionEnded"
    """An action ended; `actionId`, `actionType`, `status`: FINISHED or FAILED, `result`."""
    ERROR_RAISED = "errorRaised"
    """The robot reports a new error; `errorType`, `errorLevel`, `description`."""
    ERROR_CLEARED = "errorCleared"
    """The robot no longer reports an error; `errorType`, `errorLevel`."""
    CHARGING = "charging"
    """Charging started or stopped; `charging`, `charge` in percent."""
    LOADS = "loads"
    """The number of loads changed; `loads`, `before`."""
    MAP = "map"
    """The robot changed to another map; `mapId`, `before`."""
    POSITION = "position"
    """The robot moved by the configured distance; `x`, `y` in m, `theta` in rad, `mapId`."""
    JAM = "jam"
    """The number of robots that wait behind the robot changed; `robots`, 0: no jam."""
    STOP = "stop"
    """A stop began or ended; `stop` (name), `active`, `by`, `reason`, of an area also `xMin`, `yMin`, `xMax`,
    `yMax` in m."""
    ROBOT_FORGOTTEN = "robotForgotten"
    """A silent robot was removed for a new one."""
    TRANSPORT_ORDER = "transportOrder"
    """State or reason of a transport order changed; `state`, `before`, `reason`, `codedReason` (null: none),
    `vehicle`; at its end also `leadTime` (s, from its creation), `late` (null: no deadline), `automatic`
    (parking, recharging)."""
    LINK = "link"
    """The broker connection was established or lost; `connected`; `started`: the first one of a run."""
    HISTORY_GAP = "historyGap"
    """Events were not written; `dropped` is their number."""


class Outcome(StrEnum):
    """How a robot's order ended, as far as its states show."""

    COMPLETED = "completed"
    """The last node was reached and no action failed."""
    ABANDONED = "abandoned"
    """Cancelled or failed before the last node."""
    UNSEEN = "unseen"
    """Another order followed before a state showed the end."""


Values = dict[str, str | float | CodedReasonView | None]


@dataclass(frozen=True, slots=True)
class Event:
    """An event in the fleet; its time is that of the aggregator."""

    time: datetime
    code: Code
    text: str
    """An English sentence."""
    robot: str | None = None
    """Manufacturer and serial number."""
    order: str | None = None
    """Name of the transport order, else ID of the robot's VDA 5050 order."""
    values: Values = field(default_factory=dict)


class Change(NamedTuple):
    """A change between two states: code, sentence and values."""

    code: Code
    text: str
    values: Values


def state_changes(before: State | None, now: State) -> Iterator[Change]:
    """Return the changes between two states; of a first state only the errors."""
    yield from _error_changes(before.errors if before else (), now.errors)
    if before is None:
        return
    yield from _order_changes(before, now)
    yield from _action_changes(before, now)
    if before.operating_mode is not now.operating_mode:
        mode, old = now.operating_mode.value, before.operating_mode.value
        yield Change(Code.OPERATING_MODE, f"Operating mode {mode}.", {"mode": mode, "before": old})
    yield from _body_changes(before, now)


def _error_changes(before: tuple[ErrorEntry, ...], now: tuple[ErrorEntry, ...]) -> Iterator[Change]:
    if not before and not now:
        return
    # VDA 5050 gives errors no ID. Type and references identify one; its description may hold a distance or
    # a time, and would make the same error a new one with each state.
    old, new = (
        {
            (
                error.error_type,
                *((ref.reference_key, ref.reference_value) for ref in error.error_references),
            ): error
            for error in errors[:LIST_LIMIT]
        }
        for errors in (before, now)
    )
    for key in new.keys() - old.keys():
        entry = new[key]
        kind, text = short(entry.error_type), short(entry.error_description) or "No description."
        values: Values = {"errorType": kind, "errorLevel": entry.error_level.value}
        yield Change(Code.ERROR_RAISED, f"{kind}: {text}", {**values, "description": text})
    for key in old.keys() - new.keys():
        entry = old[key]
        kind = short(entry.error_type)
        values = {"errorType": kind, "errorLevel": entry.error_level.value}
        yield Change(Code.ERROR_CLEARED, f"Cleared: {kind}.", values)


def _order_changes(before: State, now: State) -> Iterator[Change]:
    another = now.order_id != before.order_id
    if is_active(before) and (another or not is_active(now)):
        outcome = _outcome_of(before, now)
        text = f"Order {before.order_id} {outcome.value}."
        yield Change(Code.ORDER_ENDED, text, {"orderId": before.order_id, "outcome": outcome.value})
    values: Values = {"orderId": now.order_id, "orderUpdateId": now.order_update_id}
    if another and now.order_id:
        yield Change(Code.ORDER_TAKEN, f"Accepted order {now.order_id}.", values)
    elif not another and now.order_update_id != before.order_update_id:
        yield Change(Code.ORDER_UPDATED, f"Accepted order update {now.order_update_id}.", values)
    reached = (now.last_node_id, now.last_node_sequence_id)
    if not now.last_node_id or (
        not another and reached == (before.last_node_id, before.last_node_sequence_id)
    ):
        return
    # The first node of a new order is where the robot already is (VDA 5050 3.0, 6.1.1).
    if now.last_node_id != before.last_node_id or not another:
        values = {"nodeId": now.last_node_id, "sequenceId": now.last_node_sequence_id}
        yield Change(Code.NODE_REACHED, f"Reached {now.last_node_id}.", values)


def _outcome_of(before: State, now: State) -> Outcome:
    if now.order_id != before.order_id:
        return Outcome.UNSEEN
    # Cancelling empties the remaining nodes, too (VDA 5050 3.0, 6.1.3): last node and actions tell.
    last = before.node_states[-1].sequence_id if before.node_states else 0
    failed = any(state.action_status is ActionStatus.FAILED for state in now.action_states)
    over = {each.action_id for each in _all_actions(before) if each.action_status.ended}
    cancelled = any(
        each.action_type == "cancelOrder"
        and each.action_status is not ActionStatus.FAILED
        and each.action_id not in over
        for each in _all_actions(now)
    )
    completed = now.last_node_sequence_id >= last and not (failed or cancelled)
    return Outcome.COMPLETED if completed else Outcome.ABANDONED


def _all_actions(state: State) -> tuple[ActionState, ...]:
    return (*state.action_states, *state.instant_action_states)


def _action_changes(before: State, now: State) -> Iterator[Change]:
    if not (now.action_states or now.instant_action_states):
        return
    old = {each.action_id: each.action_status for each in _all_actions(before)}
    for action in (*now.action_states[:LIST_LIMIT], *now.instant_action_states[:LIST_LIMIT]):
        if not action.action_status.ended or action.action_status is old.get(action.action_id):
            continue
        status, name = action.action_status.value, action.action_type or action.action_id
        result = short(action.action_result)
        values: Values = {
            "actionId": action.action_id,
            "actionType": action.action_type,
            "status": status,
            "result": result,
        }
        text = f"Action {name}: {status}." + (f" {result}" if result else "")
        yield Change(Code.ACTION_ENDED, text, values)


def _body_changes(before: State, now: State) -> Iterator[Change]:
    values: Values
    power = now.power_supply
    if power.charging is not before.power_supply.charging:
        text = "Charging started." if power.charging else "Charging stopped."
        values = {"charging": power.charging, "charge": power.state_of_charge}
        yield Change(Code.CHARGING, text, values)
    loads, loads_before = len(now.loads or ()), len(before.loads or ())
    if loads != loads_before:
        number = abs(loads - loads_before)
        verb = "Picked up" if loads > loads_before else "Dropped"
        text = f"{verb} {'a load' if number == 1 else f'{number} loads'}; carrying {loads}."
        yield Change(Code.LOADS, text if loads else "Empty.", {"loads": loads, "before": loads_before})
    position, old_position = now.mobile_robot_position, before.mobile_robot_position
    if position and old_position and position.map_id != old_position.map_id:
        values = {"mapId": position.map_id, "before": old_position.map_id}
        yield Change(Code.MAP, f"Changed to map {position.map_id}.", values)
