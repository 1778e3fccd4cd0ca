"""Instant actions on their way to a robot and to their end."""

from __future__ import annotations

from itertools import count

import pytest

from nena_conversations.kit.honest_robot import HonestRobot
from nena_order_service.fleet.instant_actions import CLEARING_PAUSE, LEAVING_WITHIN, InstantActionManager
from nena_order_service.fleet.outputs import InstantActionEnded, PublishInstantActions
from nena_order_service.fleet.robot import INSTANT_ACTIONS_LIMIT, Robot
from nena_order_service.fleet.settings import FleetSettings
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.factsheet import ActionScope, MobileRobotAction
from nena_shared.vda5050.state import OperatingMode
from support.fleet import Bench, make_vda_order
from support.fleet import make_action as action
from support.fleet_examples import factsheet


def ended(bench: Bench) -> InstantActionEnded:
    (only,) = bench.told(InstantActionEnded)
    return only


def shows(bench: Bench, action_type: str, status: ActionStatus, action_id: str = "i1") -> None:
    """Have the robot report the state of an instant action."""
    bench.robot.instants[action_id] = (action(action_type, action_id), status)
    bench.report()


@pytest.mark.clause("6.2.1/fleet", "6.6.9/instant")
@pytest.mark.parametrize("apart", [False, True], ids=["2.1", "3.0"])
def test_a_pause_is_sent_and_its_end_is_reported(*, apart: bool) -> None:
    bench = Bench(robot=HonestRobot(reports_instants_apart=apart)).online()
    bench.instruct(action("startPause"))
    assert bench.instants_sent() == ["startPause"]
    bench.exchange()
    assert ended(bench).status is ActionStatus.FINISHED
    assert bench.robot.paused


@pytest.mark.clause("6.2.1/fleet")
def test_an_instant_action_that_the_robot_cannot_execute_fails() -> None:
    bench = Bench().online()
    bench.instruct(action("fly"))
    bench.exchange()
    assert ended(bench).status is ActionStatus.FAILED
    assert str(ended(bench).reason) == "the robot failed to execute it"


@pytest.mark.clause("6.2.1/fleet")
def test_a_lost_action_is_resent_and_finally_fails() -> None:
    bench = Bench().online()
    bench.instruct(action("startPause"))
    bench.wait(60, reporting=True)
    assert bench.instants_sent() == ["startPause"] * 6
    assert ended(bench).status is None
    assert str(ended(bench).reason) == "sent 6 times, but the robot never reported it"


@pytest.mark.clause("6.2.1/fleet")
def test_a_reported_action_is_not_resent_and_times_out() -> None:
    bench = Bench(FleetSettings(instant_action_limit=20)).online()
    bench.instruct(action("downloadMap"))
    bench.lose()
    shows(bench, "downloadMap", ActionStatus.RUNNING)
    bench.wait(19, reporting=True)
    assert bench.told(InstantActionEnded) == []
    bench.wait(3, reporting=True)
    assert str(ended(bench).reason) == "the robot did not finish it within 20 s"
    assert len(bench.sent) == 1


def test_timeouts_are_suspended_while_the_robot_is_unreachable() -> None:
    bench = Bench(FleetSettings(instant_action_limit=20)).online()
    bench.instruct(action("downloadMap"))
    shows(bench, "downloadMap", ActionStatus.RUNNING)
    bench.connection(ConnectionState.CONNECTION_BROKEN)
    bench.wait(500)
    assert bench.told(InstantActionEnded) == []
    bench.robot.instants["i1"] = (action("downloadMap"), ActionStatus.FINISHED)
    bench.connection(ConnectionState.ONLINE)
    bench.report()
    assert ended(bench).status is ActionStatus.FINISHED


def test_an_action_that_vanishes_with_a_restart_has_ended() -> None:
    bench = Bench().online()
    bench.instruct(action("downloadMap"))
    shows(bench, "downloadMap", ActionStatus.RUNNING)
    bench.robot.restart(journal=True)
    bench.now += 1
    bench.report()
    assert str(ended(bench).reason) == "the robot no longer reports it; it may have restarted"


@pytest.mark.clause("6.2.1/fleet")
def test_an_action_for_an_offline_robot_is_not_queued() -> None:
    bench = Bench().online()
    bench.connection(ConnectionState.OFFLINE)
    bench.instruct(action("startPause"))
    assert str(ended(bench).reason) == "not sent: the robot is offline: it has disconnected from the broker"
    bench.connection(ConnectionState.ONLINE)
    bench.wait(30, reporting=True)
    assert bench.sent == []


@pytest.mark.clause("6.2.1/fleet")
def test_a_possibly_lost_action_is_not_resent_after_a_reconnect() -> None:
    bench = Bench().online()
    bench.instruct(action("startPause"))
    bench.lose()
    bench.connection(ConnectionState.CONNECTION_BROKEN)
    bench.tick()
    assert "has lost its connection to the broker; it is unknown whether it received the action" in str(
        ended(bench).reason
    )
    bench.connection(ConnectionState.ONLINE)
    bench.wait(30, reporting=True)
    assert bench.instants_sent() == ["startPause"]


@pytest.mark.clause("6.6.6/fleet")
def test_a_cancel_is_resent_only_after_manual_mode() -> None:
    bench = Bench().online()
    bench.start_and_tell(make_vda_order("m", "A", "B"))
    bench.cancel()
    bench.lose()
    bench.robot.mode = OperatingMode.MANUAL  # and it takes its time to clear the order
    bench.wait(30, reporting=True)
    assert bench.instants_sent() == ["cancelOrder"]
    bench.robot.mode = OperatingMode.AUTOMATIC
    bench.report()
    bench.exchange()
    assert bench.story()[-1] == "VdaOrderCancelled"


@pytest.mark.clause("6.6.6/fleet", "6.2.1/fleet")
def test_a_robot_in_manual_mode_is_sent_only_harmless_actions() -> None:
    bench = Bench().online()
    bench.robot.set_mode(OperatingMode.MANUAL)
    bench.report()
    bench.instruct(action("startPause"))
    assert "operating mode manual" in str(ended(bench).reason)
    bench.instruct(action("stateRequest", "i2"))
    assert bench.instants_sent() == ["stateRequest"]


@pytest.mark.clause("6.6.6/fleet", "6.2.1/fleet")
def test_a_robot_in_mode_intervened_is_sent_only_cancel_order() -> None:
    bench = Bench().online()
    bench.start_and_tell(make_vda_order("m", "A", "B"))
    bench.robot.set_mode(OperatingMode.INTERVENED)
    bench.report()
    for number, name in enumerate(("startPause", "stateRequest", "factsheetRequest", "retry")):
        bench.news.clear()
        bench.instruct(action(name, f"i{number}"))
        assert ended(bench).status is ActionStatus.FAILED
        why = "is under manual intervention, in which cancelOrder is the only instant action"
        assert str(ended(bench).reason) == f"not sent: the robot {why}"
    bench.cancel()
    assert bench.instants_sent() == ["cancelOrder"]


@pytest.mark.clause("6.1.1/ids")
def test_an_id_is_never_used_twice() -> None:
    bench = Bench().online()
    bench.instruct(action("startPause"))
    bench.exchange()
    bench.news.clear()
    bench.instruct(action("stopPause"))
    assert str(ended(bench).reason) == "not sent: the actionId 'i1' has been used before"
    assert bench.instants_sent() == ["startPause"]


def test_active_instant_actions_are_limited() -> None:
    bench = Bench().online()
    for number in range(INSTANT_ACTIONS_LIMIT + 1):
        bench.instruct(action("logReport", f"i{number}"))
    assert len(bench.instants_sent()) == INSTANT_ACTIONS_LIMIT
    assert str(ended(bench).reason) == "not sent: 50 instant actions are active at the robot"


def test_a_requested_cancel_ends_the_vda_order_and_is_reported() -> None:
    bench = Bench().online()
    bench.start_and_tell(make_vda_order("m", "A", "B"))
    bench.instruct(action("cancelOrder"))
    bench.exchange()
    assert ended(bench).status is ActionStatus.FINISHED
    assert bench.story()[-1] == "VdaOrderFailed"


def test_own_cancels_are_not_reported() -> None:
    bench = Bench().online()
    bench.start(make_vda_order("m", "A", "B"))
    bench.deliver()
    bench.cancel()
    bench.exchange()
    assert bench.told(InstantActionEnded) == []
    assert bench.ends() == {"m": 1}


def clearer() -> HonestRobot:
    """Make a robot of 3.0 that lists all that it can do."""
    kinds = ("startPause", "stopPause", "clearInstantActions")
    return HonestRobot(
        version="3.0.0",
        reports_instants_apart=True,
        lists=tuple(
            MobileRobotAction(
                action_type=each,
                action_scopes=(ActionScope.INSTANT,),
                pause_allowed=False,
                cancel_allowed=False,
            )
            for each in kinds
        ),
    )


def end_some(bench: Bench, count: int) -> None:
    for number in range(count):
        bench.instruct(action("stopPause", f"i{number}"))
        bench.exchange()


@pytest.mark.clause("6.2.3/clearInstantActions")
def test_ended_instant_actions_are_cleared_before_they_pile_up() -> None:
    bench = Bench(FleetSettings(clear_instant_actions_from=2), clearer()).online()
    end_some(bench, 2)

    assert bench.instants_sent() == ["stopPause", "stopPause", "clearInstantActions"]
    bench.exchange()
    assert [each.action_type for each in bench.robot.state().instant_action_states] == ["clearInstantActions"]
    bench.wait(5, reporting=True)
    assert bench.instants_sent().count("clearInstantActions") == 1


@pytest.mark.clause("6.2.3/clearInstantActions", "6.2.1/fleet")
def test_a_lost_clear_is_resent_unchanged() -> None:
    bench = Bench(FleetSettings(clear_instant_actions_from=1), clearer()).online()
    end_some(bench, 1)
    bench.lose()
    bench.wait(1, reporting=True)

    sent = [each.actions[0] for each in bench.sent if isinstance(each, PublishInstantActions)]
    assert [each.action_type for each in sent] == ["stopPause", "clearInstantActions", "clearInstantActions"]
    assert sent[1] == sent[2]


@pytest.mark.clause("6.2.3/clearInstantActions", "7.10")
def test_a_robot_with_little_room_is_sent_clear_earlier() -> None:
    bench = Bench(robot=clearer()).online()
    lists = bench.robot.factsheet().protocol_features.mobile_robot_actions
    little = factsheet(version="3.0.0", actions=lists, arrays={"state.instantActionStates": 6})
    bench.take(bench.fleet.on_factsheet(bench.robot.key, little, bench.now))

    end_some(bench, 3)

    assert bench.instants_sent() == ["stopPause", "stopPause", "stopPause", "clearInstantActions"]


@pytest.mark.clause("6.2.3/clearInstantActions")
@pytest.mark.parametrize(
    "robot",
    [
        pytest.param(HonestRobot(reports_instants_apart=True), id="of an older version"),
        pytest.param(HonestRobot(version="3.0.0", reports_instants_apart=True), id="that does not list it"),
    ],
)
def test_a_robot_without_clear_instant_actions_is_not_sent_it(robot: HonestRobot) -> None:
    bench = Bench(FleetSettings(clear_instant_actions_from=1), robot).online()
    end_some(bench, 1)

    assert bench.instants_sent() == ["stopPause"]


def without_factsheet() -> Bench:
    """Return a bench with a robot that is online, and whose factsheet the broker has not retained."""
    bench = Bench()
    bench.set_broker(connected=True)
    hello = bench.robot.connection(ConnectionState.ONLINE, bench.now)
    bench.take(bench.fleet.on_connection(bench.robot.key, hello, bench.now))
    bench.report()
    bench.start(make_vda_order("m", "A", "B"))
    return bench


@pytest.mark.clause("7.10")
def test_a_missing_factsheet_is_requested() -> None:
    bench = without_factsheet()

    assert (bench.instants_sent(), bench.orders_sent()) == (["factsheetRequest"], [])
    assert str(bench.view().wait_reason) == "the robot has not sent its factsheet yet"
    bench.take(bench.fleet.on_factsheet(bench.robot.key, bench.robot.factsheet(), bench.now))
    assert bench.orders_sent() == ["m"]


@pytest.mark.clause("7.10")
def test_an_order_does_not_wait_long_for_a_factsheet() -> None:
    bench = without_factsheet()
    bench.lose()

    bench.wait(1.75)
    assert bench.orders_sent() == []
    bench.wait(0.25)
    assert bench.orders_sent() == ["m"]


@pytest.mark.clause("7.10")
def test_a_robot_without_a_factsheet_is_asked_for_it_once_per_connection() -> None:
    bench = without_factsheet()
    bench.deliver()  # the robot cannot do what it is asked for
    bench.report()
    assert bench.orders_sent() == ["m"], "nobody waits for nothing"

    bench.wait(60, reporting=True)
    assert bench.instants_sent() == ["factsheetRequest"]
    hello = bench.robot.connection(ConnectionState.ONLINE, bench.now)
    bench.take(bench.fleet.on_connection(bench.robot.key, hello, bench.now))
    bench.report()
    assert bench.instants_sent() == ["factsheetRequest", "factsheetRequest"]


def alone(robot: HonestRobot | None = None) -> InstantActionManager:
    """Return a manager of an online robot."""
    honest, settings, numbers = robot or HonestRobot(), FleetSettings(clear_instant_actions_from=1), count(1)
    known = Robot(honest.key, settings)
    known.take_connection(honest.connection(ConnectionState.ONLINE), 0.0)
    known.take_factsheet(honest.factsheet())
    known.take_state(honest.state(), 0.0)
    return InstantActionManager(known, settings, lambda: f"id-{next(numbers)}", broker=True)


def test_without_our_own_link_nothing_starts_and_started_actions_wait() -> None:
    manager = alone()
    cancel = manager.begin_cancel("m")
    manager.broker = False
    (refused,) = manager.begin_requested(action("startPause"), 0.0)
    assert isinstance(refused, InstantActionEnded)
    assert "no connection to the MQTT broker" in str(refused.reason)
    assert (manager.can_cancel(0.0), manager.is_cancelling) == (False, True)
    assert list(manager.send_due(0.0)) == []
    assert list(manager.on_tick(1000.0)) == []
    assert cancel.outcome is None
    manager.broker = True
    assert len(list(manager.send_due(1000.0))) == 1


@pytest.mark.clause("6.2.3/clearInstantActions")
def test_a_clear_without_room_starts_once_there_is_room() -> None:
    robot = clearer()
    manager = alone(robot)
    for number in range(INSTANT_ACTIONS_LIMIT):
        list(manager.begin_requested(action("startPause", f"i{number}"), 0.0))
    robot.instants["old"] = (action("startPause", "old"), ActionStatus.FINISHED)
    list(manager.on_state(robot.state(), 1.0))
    assert not any("clear" in each for each in sent_types(manager, 1.0))

    robot.instants["i0"] = (action("startPause", "i0"), ActionStatus.FINISHED)
    list(manager.on_state(robot.state(), 2.0))
    list(manager.on_state(robot.state(), 2.5))
    assert sent_types(manager, 3.0).count("clearInstantActions") == 1


@pytest.mark.clause("6.2.3/clearInstantActions")
def test_a_robot_that_does_not_clear_is_sent_it_again_after_a_delay() -> None:
    robot = clearer()
    manager = alone(robot)
    robot.instants["old"] = (action("startPause", "old"), ActionStatus.FINISHED)
    told = []
    for now in (0.0, 1.0, CLEARING_PAUSE - 0.5, CLEARING_PAUSE, CLEARING_PAUSE + 1.0):
        list(manager.on_state(robot.state(), now))
        for action_type in sent_types(manager, now):
            told.append((action_type, now))
            (clearing,) = (each for each in manager.ids if each not in robot.instants)
            robot.instants[clearing] = (action(action_type, clearing), ActionStatus.FINISHED)
    assert told == [("clearInstantActions", 0.0), ("clearInstantActions", CLEARING_PAUSE)]


def sent_types(manager: InstantActionManager, now: float) -> list[str]:
    sent = (each for each in manager.send_due(now) if isinstance(each, PublishInstantActions))
    return [each.action_type for message in sent for each in message.actions]


def test_abilities_are_not_checked_before_the_factsheet() -> None:
    bench = without_factsheet()
    bench.instruct(action("sing"))
    assert bench.instants_sent() == ["factsheetRequest", "sing"]
    assert bench.told(InstantActionEnded) == []


# Hibernation and shutdown


def hibernate(bench: Bench) -> None:
    """Have the robot report the end of startHibernation, then hibernate."""
    bench.instruct(action("startHibernation", "s"))
    bench.lose()
    shows(bench, "startHibernation", ActionStatus.FINISHED, "s")
    bench.wait(1)
    bench.connection(ConnectionState.HIBERNATING)


@pytest.mark.clause("6.2.3/hibernationAsked")
@pytest.mark.parametrize("leaving", ["startHibernation", "shutdown"])
def test_a_robot_that_is_about_to_leave_gets_no_order_until_its_connection_shows_it(leaving: str) -> None:
    bench = Bench().online()
    bench.instruct(action(leaving))
    assert str(bench.view().availability.reason) == "is about to hibernate or to shut down"
    shows(bench, leaving, ActionStatus.FINISHED)
    bench.lose()
    bench.report()
    assert ended(bench).status is ActionStatus.FINISHED
    assert str(bench.view().availability.reason) == "is about to hibernate or to shut down"
    bench.start(make_vda_order("m", "A", "B"))
    assert bench.orders_sent() == []

    bench.connection(ConnectionState.HIBERNATING)
    assert str(bench.view().availability.reason) == "is hibernating"


@pytest.mark.clause("6.2.3/hibernationAsked")
@pytest.mark.parametrize("stays", ["it failed", "its connection does not change"])
def test_a_robot_that_does_not_hibernate_takes_orders_again(stays: str) -> None:
    bench = Bench().online()
    bench.instruct(action("startHibernation"))
    failed = stays == "it failed"
    status = ActionStatus.FAILED if failed else ActionStatus.FINISHED
    shows(bench, "startHibernation", status)
    assert bench.view().availability.can_take_order is failed

    bench.wait(LEAVING_WITHIN, reporting=True)
    assert bench.view().availability.can_take_order


@pytest.mark.clause("6.2.3/hibernationAsked")
def test_a_hibernating_robot_is_sent_only_stop_hibernation() -> None:
    bench = Bench().online()
    hibernate(bench)
    before = bench.instants_sent()

    bench.instruct(action("startPause", "p"))
    refused = bench.told(InstantActionEnded)[-1]
    assert str(refused.reason) == "not sent: the robot is hibernating"
    bench.instruct(action("stopHibernation", "w"))
    assert bench.instants_sent() == [*before, "stopHibernation"]

    bench.wait(1)
    bench.connection(ConnectionState.ONLINE)
    shows(bench, "stopHibernation", ActionStatus.FINISHED, "w")
    assert bench.told(InstantActionEnded)[-1].status is ActionStatus.FINISHED
    assert bench.view().availability.can_take_order


@pytest.mark.clause("6.2.3/hibernationAsked")
def test_a_robot_may_take_long_to_wake() -> None:
    bench = Bench(FleetSettings(instant_action_limit=100)).online()
    hibernate(bench)
    count = len(bench.told(InstantActionEnded))

    bench.instruct(action("stopHibernation", "w"))
    bench.wait(99)
    assert len(bench.told(InstantActionEnded)) == count
    assert bench.instants_sent().count("stopHibernation") == 6
    bench.wait(2)
    assert str(bench.told(InstantActionEnded)[-1].reason) == "sent 6 times, but the robot never reported it"


@pytest.mark.clause("6.2.3/hibernationAsked")
def test_a_new_leader_wakes_a_robot_that_does_not_report() -> None:
    bench = Bench().online()
    hibernate(bench)
    bench.set_broker(connected=True, unread=True)
    assert str(bench.view().availability.reason) == "is hibernating"

    bench.instruct(action("stopHibernation", "w"))

    assert bench.instants_sent()[-1] == "stopHibernation"

    bench.connection(ConnectionState.ONLINE)
    bench.wait(1)
    shows(bench, "stopHibernation", ActionStatus.FINISHED, "w")
    assert bench.told(InstantActionEnded)[-1].status is ActionStatus.FINISHED


@pytest.mark.clause("6.2.3/hibernationAsked")
def test_a_robot_whose_hibernation_is_revoked_gets_orders_at_once() -> None:
    bench = Bench().online()
    bench.instruct(action("startHibernation", "s"))
    shows(bench, "startHibernation", ActionStatus.FINISHED, "s")
    bench.instruct(action("stopHibernation", "w"))
    shows(bench, "stopHibernation", ActionStatus.FINISHED, "w")

    assert bench.view().availability.can_take_order


@pytest.mark.clause("6.2.3/hibernationAsked")
@pytest.mark.parametrize(
    ("leaving", "link"),
    [("startHibernation", ConnectionState.HIBERNATING), ("shutdown", ConnectionState.OFFLINE)],
)
def test_the_connection_shows_that_a_robot_has_left_if_its_last_state_is_lost(
    leaving: str, link: ConnectionState
) -> None:
    bench = Bench().online()
    bench.instruct(action(leaving, "s"))
    shows(bench, leaving, ActionStatus.RUNNING, "s")

    bench.connection(link)

    assert ended(bench).status is ActionStatus.FINISHED
    assert str(ended(bench).reason) == f"done: the robot is {link.lower()}"

    bench.connection(ConnectionState.ONLINE)
    shows(bench, leaving, ActionStatus.FINISHED, "s")
    assert bench.view().availability.can_take_order


@pytest.mark.clause("6.2.3/hibernationAsked")
def test_a_robot_that_hibernated_unseen_gets_orders_once_it_is_back() -> None:
    bench = Bench().online()
    bench.instruct(action("startHibernation", "s"))
    shows(bench, "startHibernation", ActionStatus.RUNNING, "s")
    bench.connection(ConnectionState.CONNECTION_BROKEN)
    bench.wait(1)
    bench.connection(ConnectionState.ONLINE)
    shows(bench, "startHibernation", ActionStatus.FINISHED, "s")

    assert ended(bench).status is ActionStatus.FINISHED
    assert bench.view().availability.can_take_order


@pytest.mark.clause("6.2.3/hibernationAsked")
def test_a_robot_hibernating_for_a_former_order_service_gets_no_order() -> None:
    bench = Bench(robot=HonestRobot(reports_instants_apart=True)).online()
    shows(bench, "startHibernation", ActionStatus.RUNNING, "s")
    assert str(bench.view().availability.reason) == "is about to hibernate or to shut down"

    shows(bench, "startHibernation", ActionStatus.FINISHED, "s")
    assert str(bench.view().availability.reason) == "is about to hibernate or to shut down"

    bench.wait(LEAVING_WITHIN, reporting=True)
    assert bench.view().availability.can_take_order
