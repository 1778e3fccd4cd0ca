"""Many robots under one fleet control."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from nena_conversations.kit.honest_robot import ROBOT, HonestRobot
from nena_order_service.fleet.controller import RETAINED_WITHIN, STRAY_PAUSE, RobotControl
from nena_order_service.fleet.failures import RobotBusyError
from nena_order_service.fleet.outputs import PublishOrder, RobotChanged, VdaOrderFinished
from nena_order_service.fleet.robot import LinkStatus, VdaOrderPhase
from nena_order_service.fleet.settings import FleetSettings
from nena_order_service.fleet.vda_order import released_to
from nena_shared.fleet_api.reasons import Reason
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.state import NodeState, State
from nena_shared.vda5050.topics import RobotKey
from support.fleet import Bench, hand_over, make_vda_order
from support.fleet_examples import factsheet


def test_robots_do_not_touch_each_other() -> None:
    bench = Bench().online()
    bench.start(make_vda_order("m", "A", "B"))
    other = Bench()
    other.fleet = bench.fleet
    other.robot.key = type(ROBOT)("Honest", "robot-2")
    other.online()
    bench.run()
    assert bench.told(VdaOrderFinished)
    assert other.view().order_id is None
    assert other.robot.accepted == []


def other_robot(number: int) -> RobotKey:
    return RobotKey("Honest", f"other-{number}")


def test_viewing_a_robot_does_not_register_it() -> None:
    bench = Bench(FleetSettings(robots_limit=1))
    assert bench.fleet.view(other_robot(1), 0.0).link is LinkStatus.UNKNOWN
    assert bench.fleet.has_room_for(ROBOT)


def test_a_robot_whose_states_cannot_be_read_is_not_silent() -> None:
    bench = Bench().online()
    problem = Reason.of("sends states that are unreadable: orderId: is missing")
    bench.now += bench.settings.silent_after + 1.0
    tuple(bench.control.on_malformed(problem, bench.now))
    view = bench.view()
    assert (view.link, view.availability.reason) == (LinkStatus.UNREADABLE, problem)
    bench.now += bench.settings.silent_after + 1.0
    assert bench.view().link is LinkStatus.SILENT, "nothing comes any more"


def test_a_robot_with_only_unreadable_messages_is_known() -> None:
    bench = Bench()
    bench.fleet.on_broker(connected=True, now=bench.now)
    problem = Reason.of("sends states that are unreadable: message: Invalid JSON (received 'x')")
    tuple(bench.control.on_malformed(problem, bench.now))
    assert bench.view().availability.reason == problem
    assert (bench.view().malformed, bench.fleet.view(other_robot(1), bench.now).malformed) == (1, 0)
    bench.online()
    assert bench.view().link is LinkStatus.ONLINE
    assert "cannot be read" not in str(bench.view().availability.reason)


def test_a_changed_quoted_value_is_not_a_new_problem() -> None:
    bench = Bench()
    problem = "sends states that are unreadable: orderId: no text (received {})"
    assert tuple(bench.control.on_malformed(Reason.of(problem.format(1)), bench.now))
    assert not tuple(bench.control.on_malformed(Reason.of(problem.format(2)), bench.now))


def test_all_are_known_when_every_connected_robot_has_reported() -> None:
    bench = Bench()
    bench.now += RETAINED_WITHIN
    assert not bench.fleet.all_known(bench.now), "there is no broker yet"
    bench.set_broker(connected=True)
    assert not bench.fleet.all_known(bench.now + RETAINED_WITHIN / 2), "it may have more to tell"
    bench.now += RETAINED_WITHIN
    assert bench.fleet.all_known(bench.now)

    bench.connection(ConnectionState.ONLINE)
    assert not bench.fleet.all_known(bench.now)
    bench.report()
    assert bench.fleet.all_known(bench.now)


def test_an_unreachable_robot_is_not_waited_for() -> None:
    bench = Bench()
    bench.set_broker(connected=True)
    bench.connection(ConnectionState.OFFLINE)
    assert bench.fleet.all_known(bench.now + RETAINED_WITHIN)


def test_link_duration_counts_from_the_last_connect() -> None:
    bench = Bench()
    assert bench.fleet.connected_for(50.0) == 0.0
    for connected, at, seconds in ((True, 100.0, 20.0), (False, 120.0, 0.0), (True, 130.0, 20.0)):
        bench.fleet.on_broker(connected=connected, now=at)
        bench.tick()
        assert bench.fleet.connected_for(at + 20.0) == seconds


def test_a_silent_robot_is_reported_once() -> None:
    bench = Bench().online()
    assert bench.tick() == ()
    bench.now += bench.settings.silent_after + 0.1
    assert bench.tick() == (RobotChanged(ROBOT),)
    assert str(bench.view().availability.reason) == "is silent: it has not reported its state for too long"
    assert bench.tick() == ()
    bench.report()
    bench.now += bench.settings.silent_after + 0.1
    assert bench.tick() == (RobotChanged(ROBOT),), "and anew once it was heard again"


def test_a_robot_has_one_vda_order_at_a_time() -> None:
    bench = Bench().online()
    bench.start(make_vda_order("m", "A", "B"))
    with pytest.raises(RobotBusyError, match="one VDA order at a time") as caught:
        bench.start(make_vda_order("n", "A", "B"))
    assert caught.value.order_id == "m"
    assert bench.orders_sent() == ["m"]


@pytest.mark.clause("6.1.3/fleet")
def test_an_order_accepted_too_late_is_cancelled() -> None:
    bench = Bench().online()
    bench.start(make_vda_order("m", "A", "B"))
    bench.wait(60, reporting=True)
    bench.exchange()
    assert not bench.view().availability.can_take_order
    assert bench.instants_sent() == ["cancelOrder"]
    bench.exchange()
    assert bench.view().availability.can_take_order
    assert bench.ends() == {"m": 1}


@pytest.mark.clause("6.1.3/fleet")
def test_no_order_is_sent_while_a_cancel_is_pending() -> None:
    bench = Bench().online()
    bench.start_and_tell(make_vda_order("m", "A", "B"))
    bench.cancel()
    bench.robot.step()
    bench.report()
    bench.start(make_vda_order("n", "B", "C", x=1.0))
    assert bench.orders_sent() == ["m"]
    assert str(bench.view().wait_reason) == "the robot has not yet confirmed a cancelOrder"
    bench.run()
    assert [each.order_id for each in bench.told(VdaOrderFinished)] == ["m", "n"]


def test_an_order_not_confirmed_in_time_reports_it() -> None:
    bench = Bench().online()
    bench.start(make_vda_order("m", "A", "B"))
    assert bench.view().wait_reason is None
    bench.wait(2)
    assert str(bench.view().wait_reason) == "the robot has not yet confirmed the order"


@pytest.mark.clause("6.5/fleet")
def test_an_order_for_an_unreachable_robot_waits_with_a_reason() -> None:
    bench = Bench().online()
    bench.connection(ConnectionState.CONNECTION_BROKEN)
    bench.start(make_vda_order("m", "A", "B"))
    bench.wait(120)
    assert bench.sent == []
    assert bench.view().order_phase is VdaOrderPhase.WAITING
    assert str(bench.view().wait_reason) == "the robot has lost its connection to the broker"
    bench.connection(ConnectionState.ONLINE)
    bench.report()
    bench.run()
    assert bench.told(VdaOrderFinished)


def test_delivery_restarts_when_a_robot_returns() -> None:
    bench = Bench().online()
    bench.start(make_vda_order("m", "A", "B"))
    bench.lose()
    bench.wait(5)
    bench.connection(ConnectionState.CONNECTION_BROKEN)
    bench.wait(300)
    sent = len(bench.sent)
    bench.connection(ConnectionState.ONLINE)
    bench.report()
    assert len(bench.sent) == sent + 1
    bench.run()
    assert bench.told(VdaOrderFinished)


@pytest.mark.clause("4.1/offline")
def test_nothing_is_sent_and_nothing_fails_while_our_own_link_is_down() -> None:
    bench = Bench().online()
    bench.start(make_vda_order("m", "A", "B"))
    bench.lose()
    bench.set_broker(connected=False)
    bench.wait(300)
    assert bench.orders_sent() == ["m"]
    assert "no connection to the MQTT broker" in str(bench.view().wait_reason)
    bench.set_broker(connected=True)
    bench.report()
    bench.run()
    assert bench.told(VdaOrderFinished)


def test_a_new_leader_only_asks_a_robot_for_its_state_before_its_report() -> None:
    bench = Bench().online()
    bench.start(make_vda_order("m", "A", "B"))
    bench.lose()
    bench.set_broker(connected=False)
    bench.set_broker(connected=True, unread=True)
    bench.cancel()
    bench.wait(20)
    assert (bench.orders_sent(), set(bench.instants_sent())) == (["m"], {"stateRequest"})
    reason = bench.view().availability.reason
    assert str(reason) == "has not reported its state since the order service took over"
    bench.report()
    bench.run()
    assert bench.ends() == {"m": 1}


@pytest.mark.clause("6.5/fleet")
def test_an_order_to_a_silent_robot_finally_fails() -> None:
    bench = Bench().online()
    bench.wait(30)
    bench.start(make_vda_order("m", "A", "B"))
    bench.wait(20)
    assert bench.view().link is LinkStatus.SILENT
    bench.wait(40)
    assert bench.ends() == {"m": 1}


@pytest.mark.clause("4.1/offline")
def test_a_running_vda_order_outlives_the_loss_of_the_link() -> None:
    bench = Bench().online()
    bench.start_and_tell(make_vda_order("m", "A", "B", "C"))
    bench.connection(ConnectionState.CONNECTION_BROKEN)
    bench.wait(600)
    assert bench.ends() == {}
    bench.robot.step()
    bench.robot.step()
    bench.connection(ConnectionState.ONLINE)
    bench.report()
    assert bench.told(VdaOrderFinished)
    assert bench.orders_sent() == ["m"]


def test_the_next_vda_order_is_sent_as_soon_as_the_first_is_done() -> None:
    bench = Bench().online()
    bench.start(make_vda_order("m", "A", "B"))
    bench.run()
    outputs = bench.start(make_vda_order("n", "B", "C", x=1.0))
    assert any(isinstance(each, PublishOrder) for each in outputs)
    bench.run()
    assert bench.robot.accepted == ["m", "n"]


LONG_WAY = make_vda_order("m", "A", "B", "C", operation="pick")


def extending(settings: FleetSettings | None = None) -> Bench:
    """Return a robot that drives to B, is to continue to C, and has not received that update."""
    bench = Bench(settings).online()
    bench.start_and_tell(released_to(LONG_WAY, 2))
    bench.take(bench.control.extend_order(LONG_WAY, bench.now))
    bench.lose()
    return bench


def broken_link(bench: Bench) -> None:
    bench.connection(ConnectionState.CONNECTION_BROKEN)


def own_link_down(bench: Bench) -> None:
    bench.set_broker(connected=False)


@pytest.mark.clause("6.1.2/fleet", "4.1/offline")
@pytest.mark.parametrize("go_away", [broken_link, own_link_down])
@pytest.mark.parametrize("sendings", [1, 6])
def test_an_update_does_not_fail_while_the_robot_is_unreachable(
    go_away: Callable[[Bench], None], sendings: int
) -> None:
    bench = extending()
    while len(bench.orders_sent()) < 1 + sendings:
        bench.wait(0.25)
    go_away(bench)
    bench.lose()
    bench.wait(120)
    assert bench.view().order_phase is VdaOrderPhase.RUNNING
    assert len(bench.orders_sent()) == 1 + sendings

    bench.set_broker(connected=True)
    bench.connection(ConnectionState.ONLINE)
    bench.report()
    bench.run()
    assert bench.story()[-1] == "VdaOrderFinished"
    assert "cancelOrder" not in bench.instants_sent()


@pytest.mark.clause("7.10/interval")
@pytest.mark.parametrize("is_update", [False, True])
def test_orders_and_updates_respect_the_factsheets_minimum_interval(*, is_update: bool) -> None:
    bench = Bench(FleetSettings(resend_after=0.25)).online()
    bench.take(bench.fleet.on_factsheet(ROBOT, factsheet(order_interval=3.0), bench.now))
    bench.start(released_to(LONG_WAY, 2))
    if is_update:
        bench.exchange()
        bench.take(bench.control.extend_order(LONG_WAY, bench.now))
    bench.wait(2.75)
    assert bench.orders_sent() == ["m"]
    bench.wait(0.25)
    assert bench.orders_sent() == ["m", "m"]


@pytest.mark.parametrize("is_update", [False, True])
def test_a_long_minimum_interval_is_the_reason_to_wait(*, is_update: bool) -> None:
    bench = Bench().online()
    bench.take(bench.fleet.on_factsheet(ROBOT, factsheet(order_interval=1000.0), bench.now))
    bench.start(released_to(LONG_WAY, 2) if is_update else make_vda_order("first", "A", "B"))
    if is_update:
        bench.exchange()
        bench.take(bench.control.extend_order(LONG_WAY, bench.now))
    else:
        bench.run()
        bench.start(make_vda_order("second", "B", "C"))
    assert "only every 1000 s" in str(bench.view().wait_reason)


def test_without_a_vda_order_there_is_nothing_to_cancel_or_to_extend() -> None:
    bench = Bench().online()
    assert bench.cancel() == ()
    assert bench.take(bench.control.extend_order(LONG_WAY, bench.now)) == ()
    assert bench.sent == []


def test_an_extension_of_another_vda_order_is_ignored() -> None:
    bench = Bench().online()
    bench.start_and_tell(released_to(LONG_WAY, 2))
    bench.take(bench.control.extend_order(make_vda_order("n", "A", "B", "C"), bench.now))
    bench.wait(5)
    assert bench.orders_sent() == ["m"]


@pytest.mark.clause("6.1.3/fleet")
def test_a_robot_that_executes_an_ended_order_is_cancelled_again_after_a_delay() -> None:
    bench = Bench(FleetSettings(sendings=1)).online()
    bench.start(make_vda_order("m", "A", "B"))
    bench.wait(3)
    assert bench.ends() == {"m": 1}
    bench.deliver()
    bench.robot.nodes[0] = bench.robot.nodes[0].model_copy(update={"released": False})  # it stands for long
    bench.report()
    bench.lose()
    bench.wait(STRAY_PAUSE - 1, reporting=True)
    assert bench.instants_sent() == ["cancelOrder"]
    bench.wait(3, reporting=True)
    assert bench.instants_sent() == ["cancelOrder", "cancelOrder"]


@pytest.mark.parametrize(
    ("field", "value", "worth_telling"),
    [("position", (7.0, 7.0, 1.0), False), ("charge", 80.9, False), ("charge", 79.9, True)],
)
def test_only_significant_changes_are_reported(field: str, value: Any, *, worth_telling: bool) -> None:
    bench = Bench().online()
    assert bench.report() == ()
    setattr(bench.robot, field, value)
    assert bench.report() == ((RobotChanged(ROBOT),) if worth_telling else ())
    assert bench.report() == ()


def test_a_robot_executing_its_order_is_quiet() -> None:
    settings = FleetSettings()
    control = RobotControl(ROBOT, settings, lambda: "id", broker=True)
    robot = HonestRobot()
    quiet = [control.is_quiet]
    tuple(control.on_factsheet(robot.factsheet(), 0.0))
    tuple(control.on_state(robot.state(), 0.0))
    (order,) = control.start_order(make_vda_order("m", "A", "B"), 0.0)
    assert isinstance(order, PublishOrder)
    quiet.append(control.is_quiet)
    hand_over(order, robot)
    tuple(control.on_state(robot.state(), 1.0))
    quiet.append(control.is_quiet)
    assert quiet == [True, False, True], "before it is confirmed the order may have to be sent again"
    assert tuple(control.tick(2.0)) == ()
    assert tuple(control.tick(2.0 + settings.silent_after)) == (RobotChanged(ROBOT),), "it is silent now"


def test_a_started_order_is_reported_as_a_change_only_if_it_must_wait() -> None:
    control, robot = RobotControl(ROBOT, FleetSettings(), lambda: "id", broker=True), HonestRobot()
    assert tuple(control.start_order(make_vda_order("m", "A", "B"), 0.0)) == (RobotChanged(ROBOT),)
    control = RobotControl(ROBOT, FleetSettings(), lambda: "id", broker=True)
    tuple(control.on_factsheet(robot.factsheet(), 0.0))
    tuple(control.on_state(robot.state(), 0.0))
    started = control.start_order(make_vda_order("m", "A", "B"), 0.0)
    assert [type(output) for output in started] == [PublishOrder]


class NeverDone(HonestRobot):
    """Keeps the last node of its order among those to go."""

    def state(self, seconds: float = 0.0) -> State:
        made = super().state(seconds)
        if made.node_states or not self.order_id:
            return made
        kept = NodeState(node_id=self.last_node_id, sequence_id=self.last_sequence_id, released=True)
        return made.model_copy(update={"node_states": (kept,)})


def test_a_robot_at_the_last_node_that_never_empties_its_node_states_is_named_as_the_reason() -> None:
    bench = Bench(robot=NeverDone()).online()
    bench.start_and_tell(make_vda_order("m", "A", "B"))
    assert bench.view().wait_reason is None
    bench.robot.step()
    bench.report()
    assert str(bench.view().wait_reason) == (
        "the robot stands at the last node of its order, 'B', but still lists 'B' in its nodeStates: it must "
        "empty them (with vda5050:keepsLastNodeStates: to turn to the node's heading)"
    )
    assert bench.story() == ["VdaOrderAccepted", "NodePassed"]
