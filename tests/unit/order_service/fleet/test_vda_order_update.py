"""Missions that grow: base and horizon, sent as order updates that begin at the decision point."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nena_order_service.fleet.outputs import (
    BaseWanted,
    NodePassed,
    PublishOrder,
    VdaOrderCancelled,
    VdaOrderFailed,
    VdaOrderFinished,
)
from nena_order_service.fleet.vda_order import BaseChangedError, VdaOrder, released_to, update_of
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel
from nena_shared.vda5050.order import Node
from support.fleet import Bench, make_vda_order, order_of
from support.fleet_examples import factsheet

pytestmark = pytest.mark.clause("6.1.2/fleet")

POINTS = ("A", "B", "C", "D", "E")
WHOLE = make_vda_order("m1", *POINTS, operation="pick")


def base(count: int, vda_order: VdaOrder = WHOLE) -> VdaOrder:
    """Return the VDA order with its first ``count`` nodes released."""
    return released_to(vda_order, 2 * (count - 1))


def updates(bench: Bench) -> list[tuple[int, list[str], list[str]]]:
    """Return each order that was sent: its update, its base, its horizon."""
    return [
        (
            each.order_update_id,
            [node.node_id for node in each.vda_order.nodes if node.released],
            [node.node_id for node in each.vda_order.nodes if not node.released],
        )
        for each in bench.sent
        if isinstance(each, PublishOrder)
    ]


def started(count: int = 2, **robot: Any) -> Bench:
    bench = Bench().online()
    for name, value in robot.items():
        setattr(bench.robot, name, value)
    bench.start_and_tell(base(count))
    return bench


def extend(bench: Bench, vda_order: VdaOrder) -> None:
    bench.take(bench.control.extend_order(vda_order, bench.now))


class TestTheCut:
    def test_an_update_starts_with_the_unchanged_decision_point(self) -> None:
        update = update_of(base(2), base(4))

        assert [(node.node_id, node.sequence_id, node.released) for node in update.nodes] == [
            ("B", 2, True),
            ("C", 4, True),
            ("D", 6, True),
            ("E", 8, False),
        ]
        assert update.nodes[0] == base(2).nodes[1]
        assert [edge.sequence_id for edge in update.edges] == [3, 5, 7]

    @pytest.mark.parametrize(
        "plan",
        [
            make_vda_order("m2", *POINTS),
            make_vda_order("m1", "A", "X", "C"),
            make_vda_order("m1", "A"),
            base(1),
        ],
    )
    def test_a_base_is_never_changed(self, plan: VdaOrder) -> None:
        with pytest.raises(BaseChangedError, match="m1"):
            update_of(base(2), plan)


def test_the_robot_is_sent_the_rest_stepwise() -> None:
    bench = started()
    for count in (3, 5):
        extend(bench, base(count))
        bench.exchange()
    bench.run()

    assert updates(bench) == [
        (0, ["A", "B"], ["C", "D", "E"]),
        (1, ["B", "C"], ["D", "E"]),
        (2, ["C", "D", "E"], []),
    ]
    assert [each.node_id for each in bench.told(NodePassed)] == list(POINTS)
    assert len(bench.told(VdaOrderFinished)) == 1


@pytest.mark.clause("6.6.3/fleet", "6.6.2/fleet")
def test_a_robot_at_the_end_of_its_base_waits_and_has_not_finished() -> None:
    bench = started()
    bench.run(10)

    assert bench.robot.last_node_id == "B"
    assert len(bench.told(BaseWanted)) == 1
    assert not bench.ends()
    extend(bench, WHOLE)
    bench.run()
    assert len(bench.told(VdaOrderFinished)) == 1


@pytest.mark.clause("6.6.3/fleet")
def test_a_new_base_request_is_reported_once() -> None:
    bench = started()
    for _ in range(3):
        bench.report()
    assert len(bench.told(BaseWanted)) == 1

    extend(bench, base(4))
    bench.exchange()
    bench.robot.step()
    bench.robot.step()
    bench.report()

    assert len(bench.told(BaseWanted)) == 2


def test_only_the_newest_plan_is_sent_after_a_pending_update() -> None:
    bench = started()
    for count in (3, 4, 5):
        extend(bench, base(count))
    assert [each[0] for each in updates(bench)] == [0, 1]
    bench.exchange()

    assert updates(bench)[-1] == (2, ["C", "D", "E"], [])


def test_a_plan_before_the_first_sending_replaces_the_order() -> None:
    bench = Bench()
    bench.start(base(2))
    extend(bench, base(4))

    bench.online()

    assert updates(bench) == [(0, ["A", "B", "C", "D"], ["E"])]


@pytest.mark.clause("6.1.2/confirm")
def test_a_lost_update_is_resent_unchanged() -> None:
    bench = started()
    extend(bench, base(3))
    bench.lose()
    bench.wait(1.0, reporting=True)

    assert updates(bench)[1:] == [(1, ["B", "C"], ["D", "E"])] * 2
    bench.exchange()
    extend(bench, WHOLE)
    bench.run()
    assert len(bench.told(VdaOrderFinished)) == 1


@pytest.mark.clause("6.1.2/confirm", "6.5/fleet")
@pytest.mark.parametrize("will", [True, False])
def test_an_update_lost_in_a_cut_is_resent_with_the_first_state_after_it(*, will: bool) -> None:
    """Not with ONLINE, before which a robot may not have subscribed; brokers lose wills at takeovers."""
    bench = started()
    extend(bench, base(3))
    bench.wait(7.5)
    if will:
        bench.connection(ConnectionState.CONNECTION_BROKEN)
    bench.lose()
    sendings = len(updates(bench))
    bench.wait(1.0)
    bench.connection(ConnectionState.ONLINE)
    bench.tick()
    assert len(updates(bench)) == sendings

    bench.report()
    assert len(updates(bench)) == sendings + 1
    bench.exchange()
    assert bench.view().order_id == "m1"


@pytest.mark.clause("6.1.2/confirm")
def test_an_update_that_is_never_accepted_ends_the_vda_order() -> None:
    bench = started()
    extend(bench, base(3))
    for _ in range(60):
        bench.lose()
        bench.wait(1.0, reporting=True)
        if "cancelOrder" in bench.instants_sent():
            break
    bench.exchange()
    bench.tick()

    (failed,) = bench.told(VdaOrderFailed)
    assert "an update was sent 6 times" in str(failed.reason)


def test_an_update_that_the_broker_refuses_ends_the_vda_order() -> None:
    bench = started()
    extend(bench, base(3))
    bench.lose()
    bench.take(bench.control.on_undeliverable("uagv/v2/ACME/r1/order", bench.now))
    assert bench.instants_sent() == ["cancelOrder"]
    bench.exchange()
    bench.tick()

    (failed,) = bench.told(VdaOrderFailed)
    assert "uagv/v2/ACME/r1/order" in str(failed.reason)


@pytest.mark.clause("6.1.4/fleet")
@pytest.mark.parametrize("named", [True, False])
def test_a_robot_drives_on_after_it_refused_an_update_and_takes_it_later(*, named: bool) -> None:
    bench = started(refuses_updates=True, names_refusals=named)
    extend(bench, base(3))
    for _ in range(3):
        bench.exchange()
        bench.wait(1.0, reporting=True)
    assert (bench.told(VdaOrderFailed), bench.instants_sent()) == ([], [])
    assert "the robot refuses to continue the order" in str(bench.control.view(bench.now).wait_reason)
    assert "OUTDATED_ORDER_UPDATE" in str(bench.control.view(bench.now).wait_reason)

    bench.robot.refuses_updates = False
    bench.robot.errors.clear()
    bench.wait(10.0, reporting=True)
    bench.exchange()
    assert bench.control.view(bench.now).wait_reason is None
    extend(bench, WHOLE)
    bench.run()

    assert len(bench.told(VdaOrderFinished)) == sum(bench.ends().values()) == 1


@pytest.mark.clause("6.1.4/fleet")
def test_a_robot_that_always_refuses_fails_the_order_at_the_end_of_its_base() -> None:
    bench = started(refuses_updates=True)
    extend(bench, base(3))
    for _ in range(60):
        bench.exchange()
        bench.wait(1.0, reporting=True)
    assert (bench.told(VdaOrderFailed), bench.instants_sent()) == ([], []), "it still drives to B"
    assert len(updates(bench)) == 1 + bench.settings.sendings

    bench.robot.step()
    bench.report()
    bench.wait(1.0, reporting=True)
    bench.exchange()
    bench.tick()

    (failed,) = bench.told(VdaOrderFailed)
    assert "the robot refuses to continue the order" in str(failed.reason)


@pytest.mark.clause("6.1.4/fleet")
def test_a_newer_plan_replaces_the_update_that_was_refused() -> None:
    bench = started(refuses_updates=True)
    extend(bench, base(3))
    bench.exchange()
    extend(bench, WHOLE)
    bench.exchange()
    bench.robot.refuses_updates = False
    bench.wait(10.0, reporting=True)

    bench.run()

    assert (2, ["B", "C", "D", "E"], []) in updates(bench)
    assert len(bench.told(VdaOrderFinished)) == sum(bench.ends().values()) == 1


@pytest.mark.clause("6.1.4/fleet")
def test_a_refusal_of_a_foreign_message_does_not_refuse_the_accepted_update() -> None:
    bench = started()
    extend(bench, WHOLE)
    bench.robot.errors.append(ErrorEntry(error_type="validationError", error_level=ErrorLevel.WARNING))
    bench.report()
    bench.tick()
    bench.run()

    assert len(bench.told(VdaOrderFinished)) == sum(bench.ends().values()) == 1


def test_a_cancel_during_a_pending_update_ends_the_vda_order() -> None:
    bench = started()
    extend(bench, base(3))
    bench.cancel()
    bench.exchange()
    bench.run(3)

    assert len(bench.told(VdaOrderCancelled)) == 1
    assert [each[0] for each in updates(bench)] == [0, 1]


@pytest.mark.clause("6.1.2/confirm")
@pytest.mark.parametrize("arrived", [True, False])
def test_after_a_restart_the_rest_is_sent_to_a_robot_that_has_an_older_update(*, arrived: bool) -> None:
    before = started()
    extend(before, base(4))
    if arrived:
        before.deliver()
    after = Bench(robot=before.robot)
    after.now = 500.0
    after.set_broker(connected=True)
    after.take(after.control.adopt_order(base(4), after.now, accepted=True, update_id=1))
    after.online()

    assert updates(after) == ([] if arrived else [(1, ["B", "C", "D"], ["E"])])
    after.run(5)
    extend(after, WHOLE)
    after.run()
    assert len(after.told(VdaOrderFinished)) == 1


def lists_little(bench: Bench) -> Bench:
    """Make the robot support only the position of a node's optional fields."""
    little = factsheet(demands=("order.nodes.nodePosition",), order_interval=0.0)
    bench.take(bench.fleet.on_factsheet(bench.robot.key, little, bench.now))
    return bench


def nodes_sent(bench: Bench) -> dict[int, list[Node]]:
    """Return the nodes of each order that was sent, by the number of the update."""
    orders = (each for each in bench.sent if isinstance(each, PublishOrder))
    return {each.order_update_id: list(each.vda_order.nodes) for each in orders}


@pytest.mark.clause("7.10")
def test_an_update_repeats_its_first_node_as_it_was_sent_before_a_restart() -> None:
    before = lists_little(Bench().online())
    before.start(base(2))
    before.deliver()
    after = Bench(robot=before.robot)
    after.now = 500.0
    after.online()
    lists_little(after)
    after.take(after.control.adopt_order(base(2), after.now, accepted=True))
    after.report()

    extend(after, base(4))

    first, second = nodes_sent(before)[0], nodes_sent(after)[1]
    assert second[0] == first[1]
    assert [each.node_position and each.node_position.allowed_deviation_xy for each in second] == [None] * 4


@pytest.mark.clause("7.10")
def test_after_a_restart_an_update_has_no_speeds_for_a_robot_without_a_factsheet() -> None:
    limited = tuple(each.model_copy(update={"maximum_speed": 0.5}) for each in WHOLE.edges)
    whole = WHOLE.model_copy(update={"edges": limited})
    after = Bench()
    after.robot.take_order(order_of(base(2), after.robot))
    after.set_broker(connected=True)
    after.take(after.control.adopt_order(base(4, whole), after.now, accepted=True, update_id=1))
    after.report()

    sent = [each.vda_order for each in after.sent if isinstance(each, PublishOrder)]
    assert [edge.maximum_speed for each in sent for edge in each.edges] == [None] * 3


@pytest.mark.clause("7.10")
def test_a_late_factsheet_keeps_the_base_as_sent() -> None:
    bench = started()
    lists_little(bench)

    bench.take(bench.control.release_base(WHOLE.order_id, 6, bench.now))

    sent = nodes_sent(bench)
    assert sent[1][0] == sent[0][1]
    assert [each.node_position and each.node_position.allowed_deviation_xy for each in sent[1][1:]] == [
        None
    ] * 3
    bench.run()
    assert bench.told(VdaOrderFailed) == []


@pytest.mark.parametrize("last", [4, None])
def test_releasing_the_base_sends_what_the_longer_plan_would(last: int | None) -> None:
    planned, released = started(), started()

    extend(planned, WHOLE if last is None else base(last // 2 + 1))
    released.take(released.control.release_base(WHOLE.order_id, last, released.now))

    assert nodes_sent(released) == nodes_sent(planned)
    assert len(nodes_sent(released)) == 2


def test_a_released_base_of_another_order_is_ignored() -> None:
    bench = started()

    bench.take(bench.control.release_base("another", 4, bench.now))

    assert len(nodes_sent(bench)) == 1


@settings(max_examples=100)
@given(st.data())
def test_over_an_unreliable_link_every_node_is_driven_once_and_the_order_ends(data: st.DataObject) -> None:
    bench = Bench().online()
    count = data.draw(st.integers(1, 5), label="first base")
    bench.start(base(count))
    for _ in range(60):
        what = data.draw(st.sampled_from(["deliver", "lose", "extend", "step", "report", "wait"]))
        if what == "extend" and count < len(POINTS):
            count = data.draw(st.integers(count, len(POINTS)))
            extend(bench, base(count))
        elif what == "deliver":
            bench.deliver()
        elif what == "lose":
            bench.lose()
        elif what == "step":
            bench.robot.step()
        elif what == "wait":
            bench.wait(0.5)
        else:
            bench.report()
    extend(bench, WHOLE)
    bench.run(40)

    assert [each.order_id for each in bench.told(VdaOrderFinished)] == ["m1"]
    assert [each.node_id for each in bench.told(NodePassed)] == list(POINTS)
    assert bench.robot.executed == ["m1/pick"]
    numbers = [each[0] for each in updates(bench)]
    assert numbers == sorted(numbers)
