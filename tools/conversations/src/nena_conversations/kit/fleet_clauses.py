"""The clauses that a fleet control is tested against, in the order in which they are tried."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from nena_conversations.kit.clause import ClauseFailedError, Clauses, NotApplicableError, Strength, require
from nena_conversations.kit.fleet_session import FleetSession, Wanted, content_of
from nena_conversations.kit.played_robot import PlayedRobot
from nena_shared.vda5050.error import ErrorLevel, ErrorType
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import OperatingMode

ENOUGH: Final = 5
"""Times that a refused order may come again, within the time of a watch."""
PER_SECOND: Final = 2.0
"""The same per second: what comes more often is a loop."""

FLEET_CLAUSES: Final[Clauses[FleetSession]] = Clauses()
_clause = FLEET_CLAUSES.add


def _others(fleet: FleetSession, first: int, order: Order) -> list[str]:
    """Return the IDs of new orders that came after the first so many, and are not ``order``."""
    # an earlier one may come again, late
    known = {order.order_id, *(each.order_id for _, each in fleet.player.orders[:first])}
    return [each.order_id for each in fleet.sent_since(first) if each.order_id not in known]


@_clause("order/start", "An order comes to an idle robot that is ONLINE", ("6.6", "6.1"))
async def _order_comes(fleet: FleetSession) -> None:
    await fleet.taken(await fleet.asked("an order after it was asked for"))


@_clause("order/complete", "An order is released to its end while the robot does it", ("6.6.2", "6.1.2"))
async def _order_is_completed(fleet: FleetSession) -> None:
    await fleet.driving()
    await fleet.done("the end of the order, with all nodes released")


@_clause("order/positions", "Nodes have a position on the robot's map", ("6.7", "7.3"), Strength.MAY)
async def _nodes_have_positions(fleet: FleetSession) -> None:
    order = await fleet.driving()
    bare = [node.node_id for node in order.nodes if node.node_position is None]
    require(not bare, f"nodes without a position: {', '.join(bare)}")
    maps = {node.node_position.map_id for node in order.nodes if node.node_position}
    require(maps == {fleet.player.robot.map_id}, f"the order is on the maps {', '.join(sorted(maps))}")


@_clause("order/next", "The next order has another orderId", ("6.6.1", "6.1.1"))
async def _orders_have_their_own_ids(fleet: FleetSession) -> None:
    known = {order.order_id for _, order in fleet.player.orders}
    order = await fleet.ordered()
    require(order.order_id not in known, f"orderId {order.order_id!r} was used for an earlier order")


@_clause(
    "order/confirmed",
    "An order that the robot confirms is not sent again",
    ("6.6.4.3", "6.1.4.5"),
    Strength.SHOULD,
)
async def _confirmed_order_is_left_alone(fleet: FleetSession) -> None:
    order = await fleet.driving()
    await fleet.settle()  # the state and a repeated order may cross
    first = len(fleet.player.orders)

    def is_repeated() -> bool:
        repeated = (order.order_id, order.order_update_id)
        return any((each.order_id, each.order_update_id) == repeated for each in fleet.sent_since(first))

    await fleet.never(is_repeated, "an order that a state shows was sent again")


@_clause("order/lost", "An order that was lost is sent again", ("6.6.4.3", "6.1.4.5"), Strength.SHOULD)
async def _lost_order_is_repeated(fleet: FleetSession) -> None:
    fleet.player.deaf = True
    order = await fleet.ordered()
    fleet.player.deaf = False
    await fleet.taken(order)


@_clause("order/lostSame", "An order that is sent again is the same", ("6.6.4.3", "6.1.4.5"))
async def _repeated_order_is_the_same(fleet: FleetSession) -> None:
    fleet.player.deaf = True
    first = len(fleet.player.orders)
    order = await fleet.ordered()
    if not await fleet.came_true(lambda: len(fleet.player.orders) > first + 1, fleet.answer_within):
        raise NotApplicableError("the fleet control sends no order again")
    require(not _others(fleet, first, order), "another order follows one that the robot did not confirm")
    for each in fleet.sent_since(first):
        same = each.order_update_id != order.order_update_id or content_of(each) == content_of(order)
        require(same, f"update {each.order_update_id} is sent again with another content")


@_clause("order/slow", "A robot that answers slowly gets no other order", ("6.6.2", "6.1.4.6"))
async def _slow_robot_is_waited_for(fleet: FleetSession) -> None:
    fleet.player.slow = fleet.watch
    first = len(fleet.player.orders)
    order = await fleet.ordered()
    await fleet.never(lambda: _others(fleet, first, order), "another order came before the robot answered")


def _refused(id_: str, title: str, sections: tuple[str | None, str], kind: ErrorType) -> None:
    """Register a clause on an order that the robot refuses."""

    @_clause(f"refused/{id_}", title, sections)
    async def refused_order_is_not_sent_forever(fleet: FleetSession) -> None:
        fleet.player.refuses = kind
        first = len(fleet.player.orders)
        await fleet.ordered()
        await _no_flood(fleet, lambda: len(fleet.player.orders) - first, "a refused order")


async def _no_flood(fleet: FleetSession, count: Callable[[], int], what: str) -> None:
    most = max(ENOUGH, fleet.watch * PER_SECOND)
    await fleet.never(lambda: count() > most, f"{what} came more than {most:g} times in {fleet.watch:g} s")


_refused(
    "order",
    "An order that the robot cannot do is not sent without end",
    ("6.6.4.2", "6.1.4.3"),
    ErrorType.INVALID_ORDER_ACTION,
)
_refused(
    "validation",
    "An order that the robot finds invalid is not sent without end",
    ("6.6.4.1", "6.1.4.1"),
    ErrorType.VALIDATION_FAILURE,
)
_refused(
    "route",
    "An order without a route is not sent without end",
    ("6.6.4", "6.1.4.8"),
    ErrorType.NO_ROUTE_TO_TARGET,
)


@_clause(
    "refused/next",
    "After a refused order, another one is sent on request",
    ("6.6.4", "6.1.4"),
    Strength.SHOULD,
)
async def _refusal_blocks_nothing(fleet: FleetSession) -> None:
    fleet.player.refuses = ErrorType.INVALID_ORDER_ACTION
    await fleet.ordered()
    await fleet.settle()
    fleet.player.refuses = None
    await fleet.ask(Wanted.RELEASE)
    await fleet.taken(await fleet.asked("an order after one was refused"))


@_clause("refused/update", "A refused update is not sent without end", ("6.6.4.3", "6.1.4.4"))
async def _refused_update_is_not_sent_forever(fleet: FleetSession) -> None:
    order = await fleet.driving()
    if order.nodes[-1].released:
        raise NotApplicableError("the order came without a horizon, so no update follows")
    fleet.player.robot.refuses_updates, fleet.player.holds = True, False
    first = len(fleet.player.orders)
    await fleet.came_true(lambda: len(fleet.player.orders) > first, fleet.answer_within)
    await _no_flood(fleet, lambda: len(fleet.player.orders) - first, "a refused update")


def _no_order(
    id_: str,
    title: str,
    sections: tuple[str | None, str],
    change: Callable[[PlayedRobot], object],
    strength: Strength = Strength.MUST,
) -> None:
    """Register a clause on a change of a robot after which it gets no order."""

    @_clause(id_, title, sections, strength)
    async def robot_gets_no_order(fleet: FleetSession) -> None:
        change(fleet.player)
        fleet.player.report()
        await fleet.settle()
        first = len(fleet.player.orders)
        await fleet.ask(Wanted.ORDER)
        fleet.owed = True
        await fleet.never(
            lambda: len(fleet.player.orders) > first, f"an order came: {title[0].lower()}{title[1:]}"
        )


_no_order(
    "mode/manual",
    "A robot in MANUAL gets no order",
    ("6.10.6", "6.6.6"),
    lambda robot: robot.set_mode(OperatingMode.MANUAL),
)
_no_order(
    "mode/service",
    "A robot in SERVICE gets no order",
    ("6.10.6", "6.6.6"),
    lambda robot: robot.set_mode(OperatingMode.SERVICE),
)
_no_order(
    "connection/offline",
    "A robot that is OFFLINE gets no order",
    ("6.14", "6.5"),
    lambda robot: robot.leave(),
    Strength.SHOULD,
)
_no_order(
    "error/fatal",
    "A robot with a FATAL error gets no order",
    ("6.10.5", "6.6.5"),
    lambda robot: robot.has_error("motorDefect", ErrorLevel.FATAL),
)
_no_order(
    "error/emergencyStop",
    "A robot with a pressed emergency stop gets no order",
    ("6.10.6", "7.8"),
    lambda robot: robot.press_stop(),
    Strength.MAY,
)


@_clause(
    "mode/automatic",
    "A robot that is back in AUTOMATIC gets orders again",
    ("6.10.6", "6.6.6"),
    Strength.SHOULD,
)
async def _automatic_robot_gets_orders(fleet: FleetSession) -> None:
    fleet.player.set_mode(OperatingMode.MANUAL)
    await fleet.settle()
    fleet.player.set_mode(OperatingMode.AUTOMATIC)
    await fleet.asked("an order after MANUAL")


@_clause(
    "mode/cleared", "After MANUAL in an order, the next one begins where the robot is", ("6.10.6", "6.6.7")
)
async def _cleared_order_is_over(fleet: FleetSession) -> None:
    order = await fleet.driving()
    fleet.player.set_mode(OperatingMode.MANUAL)
    await fleet.settle()
    first = len(fleet.player.orders)
    await fleet.never(lambda: len(fleet.player.orders) > first, "an order was sent to a robot in MANUAL")
    fleet.player.set_mode(OperatingMode.AUTOMATIC)
    following = await fleet.ordered(accept=lambda each: each.order_id != order.order_id)
    require(following.nodes[0].sequence_id == 0, "the order after MANUAL does not begin with sequenceId 0")


@_clause("connection/online", "A robot that is ONLINE again gets orders", ("6.14", "6.5"), Strength.SHOULD)
async def _returned_robot_gets_orders(fleet: FleetSession) -> None:
    fleet.player.leave()
    await fleet.settle()
    fleet.player.come_back()
    await fleet.asked("an order after the robot came back")


@_clause("connection/kept", "A robot that loses its link keeps its order", ("6.2", "4.1"))
async def _order_survives_a_lost_link(fleet: FleetSession) -> None:
    order = await fleet.driving()
    first = len(fleet.player.orders)
    await _lose_link(fleet)
    await fleet.never(lambda: _others(fleet, first, order), "another order came after the link was lost")
    await fleet.done("the end of the order after the link was lost")


async def _lose_link(fleet: FleetSession) -> None:
    connects = fleet.player.link.state.connects
    fleet.player.lose_link(fleet.watch)
    await fleet.until(lambda: not fleet.player.link.state.connected, "the lost link")
    await fleet.came_true(lambda: fleet.player.link.state.connects > connects, fleet.watch + 5)


@_clause("connection/replayed", "After a lost link, the confirmed order is not changed", ("6.2", "4.1"))
async def _order_is_not_changed_by_a_lost_link(fleet: FleetSession) -> None:
    order = await fleet.driving()
    first = len(fleet.player.orders)
    await _lose_link(fleet)
    await fleet.never(
        lambda: any(
            each.order_update_id <= order.order_update_id and content_of(each) != content_of(order)
            for each in fleet.sent_since(first)
            if each.order_id == order.order_id
        ),
        "the order was sent again with another content",
    )


@_clause("restart/lost", "A robot that restarts without its order gets no update of it", ("6.6.2", "6.1.2"))
async def _lost_order_gets_no_update(fleet: FleetSession) -> None:
    order = await fleet.driving()
    first = len(fleet.player.orders)
    fleet.player.restart()
    await fleet.never(
        lambda: any(
            each.order_id == order.order_id and each.order_update_id > order.order_update_id
            for each in fleet.sent_since(first)
        ),
        "an update was sent to a robot that has lost its order",
    )


@_clause("restart/next", "A robot that restarts gets orders again", ("6.6", "6.1"), Strength.SHOULD)
async def _restarted_robot_gets_orders(fleet: FleetSession) -> None:
    await fleet.driving()
    fleet.player.restart()
    await fleet.settle()
    first = len(fleet.player.orders)
    fleet.player.holds = False
    await fleet.ask(Wanted.ORDER)
    await fleet.until(
        lambda: any(each.nodes[0].sequence_id == 0 for each in fleet.sent_since(first)),
        "a new order after the restart",
    )


@_clause("cancel/sent", "cancelOrder cancels an order", ("6.6.3", "6.1.3"))
async def _cancel_is_sent(fleet: FleetSession) -> None:
    await _cancelled(fleet)
    await fleet.until(lambda: fleet.player.robot.cleared, "cancelOrder in a form that the robot can do")


async def _cancelled(fleet: FleetSession) -> int:
    """Ask for an order and its cancel; return the number of instant actions before it."""
    await fleet.driving()
    first = len(fleet.player.instants)
    await fleet.ask(Wanted.CANCEL)
    if not await fleet.came_true(lambda: fleet.actions_since(first, "cancelOrder"), fleet.answer_within):
        raise ClauseFailedError(
            f"no cancelOrder came within {fleet.answer_within:g} s after it was asked for"
        )
    return first


@_clause("cancel/named", "cancelOrder names the active order", (None, "6.1.3"), Strength.MAY)
async def _cancel_names_its_order(fleet: FleetSession) -> None:
    first = await _cancelled(fleet)
    (action, *_) = fleet.actions_since(first, "cancelOrder")
    named = action.parameter("orderId")
    require(
        named == fleet.player.robot.order_id,
        f"cancelOrder names {named!r}, not {fleet.player.robot.order_id!r}",
    )


@_clause("cancel/once", "A cancelOrder that the robot has done is not sent again", ("6.6.3", "6.1.3"))
async def _cancel_is_not_repeated(fleet: FleetSession) -> None:
    first = await _cancelled(fleet)
    await fleet.until(lambda: fleet.player.robot.cleared, "a cancelled order")
    await fleet.settle()
    ids = {each.action_id for each in fleet.actions_since(first, "cancelOrder")}

    def is_repeated() -> bool:
        return any(each.action_id not in ids for each in fleet.actions_since(first, "cancelOrder"))

    await fleet.never(is_repeated, "another cancelOrder followed the end of the order")


@_clause("cancel/waits", "No new order comes before the end of cancelOrder", ("6.6.3", "6.1.3"))
async def _next_order_waits_for_the_cancel(fleet: FleetSession) -> None:
    order = await fleet.driving()
    fleet.player.slow = fleet.watch
    first, actions = len(fleet.player.orders), len(fleet.player.instants)
    await fleet.ask(Wanted.CANCEL)
    if not await fleet.came_true(lambda: fleet.actions_since(actions, "cancelOrder"), fleet.answer_within):
        raise NotApplicableError("no cancelOrder came")
    await fleet.ask(Wanted.ORDER)
    await fleet.came_true(lambda: fleet.player.robot.cleared or _others(fleet, first, order), fleet.watch * 2)
    require(
        fleet.player.robot.cleared or not _others(fleet, first, order),
        "an order came before cancelOrder had ended",
    )


@_clause(
    "cancel/next", "After cancelOrder, another order is sent on request", ("6.6.3", "6.1.3"), Strength.SHOULD
)
async def _order_follows_a_cancel(fleet: FleetSession) -> None:
    await _cancelled(fleet)
    await fleet.until(lambda: fleet.player.robot.cleared, "a cancelled order")
    await fleet.asked("an order after the cancelled one")


@_clause("error/warning", "A robot with a WARNING goes on", ("6.10.5", "6.6.5"), Strength.SHOULD)
async def _warned_robot_gets_orders(fleet: FleetSession) -> None:
    fleet.player.has_error("dirtyLens", ErrorLevel.WARNING)
    fleet.player.report()
    await fleet.settle()
    await fleet.ordered()
    fleet.player.has_error("dirtyLens", ErrorLevel.WARNING)  # the order has cleared it
    await fleet.done("the end of an order in spite of a WARNING")


def _read(
    id_: str, title: str, sections: tuple[str | None, str], change: Callable[[dict[str, object]], object]
) -> None:
    """Register a clause on states that a fleet control must be able to read."""

    @_clause(f"read/{id_}", title, sections, Strength.SHOULD)
    async def order_is_done_in_spite_of_it(fleet: FleetSession) -> None:
        fleet.player.dialect = change
        await fleet.driving()
        await fleet.done("the end of the order")


_read(
    "unknownFields",
    "States with fields of the manufacturer are read",
    ("6.1", "7.1"),
    lambda state: state.update(acmeMood={"level": 3}),
)
_read(
    "headerId",
    "States whose headerId begins again are read",
    ("6.4", "7.2"),
    lambda state: state.update(headerId=0),
)
_read(
    "order",
    "States with another order of fields are read",
    ("6.1", "7.1"),
    lambda state: [state.update({key: state.pop(key)}) for key in sorted(state)],
)
_read(
    "decimals",
    "Timestamps with other decimals are read",
    ("6.4", "7.2"),
    lambda state: state.update(timestamp=f"{str(state['timestamp'])[:19]}.123456Z"),
)
