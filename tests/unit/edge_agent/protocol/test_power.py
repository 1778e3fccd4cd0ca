"""Hibernation and shutdown (section 6.2.3), and what a robot does in between."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_edge_agent.driver.port import GoalReport, GoalTable, Halted, HaltFailed, VelocityReport
from nena_edge_agent.protocol.declaration import HIBERNATION, POWER_ACTIONS, PREDEFINED, supported_actions
from nena_edge_agent.protocol.events import (
    Event,
    GoOnline,
    Halt,
    Hibernate,
    InstantActionsReceived,
    JournalReport,
    LinkReport,
    LogIgnored,
    MessageRefused,
    OperatingModeSwitched,
    OrderReceived,
    PowerCommand,
    PowerReport,
    ReportState,
    ResponsesReceived,
    ShutDown,
    SignedOff,
    StartAction,
    Started,
    TimePassed,
    Wake,
    ZoneSetReceived,
)
from nena_edge_agent.protocol.power import STANDSTILL_TIMEOUT
from nena_edge_agent.protocol.robot_state import PowerPhase
from nena_shared.vda5050.error import ErrorType, error
from nena_shared.vda5050.state import OperatingMode
from nena_shared.vda5050.versions import RULES
from support.robot_core import Bench, action, instant, order, restarted
from support.zones import responses, transfer, zone

NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)
AT_SIX = "2026-01-01T18:00:00.000Z"
SIX = datetime(2026, 1, 1, 18, tzinfo=UTC)
HAS_SLEPT = PowerReport(PowerCommand.HIBERNATE)
HAS_WOKEN = PowerReport(PowerCommand.WAKE)
IN_3 = tuple(each for each in RULES if each >= "3")


def sleep(action_id: str = "s", at: Any = AT_SIX) -> InstantActionsReceived:
    return instant(action(action_id, "NONE", "startHibernation", wakeUpTime=at))


def wake(action_id: str = "w") -> Event:
    return instant(action(action_id, "NONE", "stopHibernation"))


def shutdown() -> Event:
    return instant(action("d", "NONE", "shutdown"))


def robot(version: str = "3.0.1") -> Bench:
    bench = Bench(rules=RULES[version], power=POWER_ACTIONS)
    bench.do(TimePassed(NOON))
    return bench


def hibernating(version: str = "3.0.1") -> Bench:
    bench = robot(version)
    bench.do(sleep(), SignedOff(), HAS_SLEPT)
    assert bench.core.power is PowerPhase.HIBERNATING
    bench.effects.clear()
    return bench


def kinds(effects: list[Any]) -> list[type]:
    return [type(each) for each in effects]


@pytest.mark.clause("6.2.3/startHibernation", "6.2.3/shutdown")
@pytest.mark.parametrize("version", RULES)
@pytest.mark.parametrize("power", [frozenset(), HIBERNATION, frozenset({"shutdown"}), POWER_ACTIONS])
def test_a_robot_offers_its_configured_actions_if_its_version_has_them(
    version: str, power: frozenset[str]
) -> None:
    offered = set(supported_actions(PREDEFINED, RULES[version], power)) & POWER_ACTIONS

    assert offered == (power if version in IN_3 else frozenset())


@pytest.mark.clause("6.2.3/startHibernation")
@pytest.mark.parametrize("version", IN_3)
def test_the_order_ends_and_the_robot_stops_before_it_hibernates(version: str) -> None:
    bench = robot(version)
    bench.send(order("n0", "n1", "n2", node_actions={"n2": [action("later", "HARD")]}))

    assert Halt in kinds(bench.do(sleep()))
    assert bench.status("s") == "RUNNING"
    assert bench.core.power is PowerPhase.FALLING_ASLEEP
    bench.do(OrderReceived(order("n0", "n1", order_id="o2")))
    assert bench.errors == ["MOBILE_ROBOT_NOT_AVAILABLE"]

    assert kinds(bench.halted()) == [ReportState]
    assert (bench.status("s"), bench.statuses()["later"], bench.nodes) == ("FINISHED", "FAILED", [])
    assert (bench.state.order_id, bench.state.last_node_id) == ("o1", "n0")
    assert bench.do(SignedOff()) == [Hibernate(SIX)]
    assert not bench.do(HAS_SLEPT)


@pytest.mark.clause("6.2.3/startHibernation")
def test_an_action_that_cannot_be_cancelled_runs_to_its_end_first() -> None:
    bench = robot()
    bench.send(order("n0", node_actions={"n0": [action("p", "HARD", "press")]}))
    bench.runs("p")

    bench.do(sleep())
    assert bench.status("s") == "RUNNING"
    bench.finishes("p")
    assert bench.status("s") == "FINISHED"


@pytest.mark.clause("6.2.3/startHibernation")
@pytest.mark.parametrize("version", IN_3)
@pytest.mark.parametrize(
    "at",
    [
        "tomorrow",
        "2026-01-01T18:00:00.000",
        "2026-01-01T18:00:00.000+00:00",
        "2026-01-01T18:00:00+01:00",
        "20260101T180000Z",
        "2026-13-01T18:00:00Z",
        "2026-01-01",
        "",
        1767290400,
        "2026-01-01T11:59:59.999Z",
    ],
)
def test_an_invalid_or_past_wake_up_time_is_refused(version: str, at: Any) -> None:
    bench = robot(version)

    bench.do(sleep(at=at))

    assert bench.status("s") == "FAILED"
    assert bench.errors == ["INVALID_INSTANT_ACTION"]
    assert bench.core.power is PowerPhase.AWAKE


@pytest.mark.clause("6.2.3/startHibernation")
def test_without_a_wake_up_time_a_robot_hibernates_until_it_is_woken() -> None:
    bench = robot()

    bench.instant(action("s", "NONE", "startHibernation"))

    assert bench.do(SignedOff()) == [Hibernate(None)]
    assert (bench.status("s"), bench.errors) == ("FINISHED", [])
    assert PREDEFINED["startHibernation"].parameters[0].required is False


@pytest.mark.parametrize("at", [AT_SIX, "2026-01-01T18:00:00Z", "2026-01-01T18:00:00.000000000Z"])
def test_any_number_of_decimals_is_accepted(at: str) -> None:
    bench = robot()

    bench.do(sleep(at=at))

    assert bench.do(SignedOff()) == [Hibernate(SIX)]


@pytest.mark.clause("6.2.3/startHibernation")
@pytest.mark.parametrize(
    "message",
    [
        OrderReceived(order("n0", "n1")),
        instant(action("i", "NONE", "stateRequest")),
        instant(action("i", "NONE", "shutdown")),
        sleep("again"),
        ZoneSetReceived(transfer(zone("gate", "RELEASE", 13, 17))),
        ResponsesReceived(responses("r1", "GRANTED"), NOON),
        MessageRefused(error(ErrorType.VALIDATION_FAILURE, "unreadable")),
    ],
    ids=lambda event: type(event).__name__,
)
def test_a_hibernating_robot_ignores_all_messages_but_stop_hibernation(message: Event) -> None:
    bench = hibernating()
    before = bench.state

    assert kinds(bench.do(message)) == [LogIgnored]
    assert bench.state == before


@pytest.mark.clause("6.2.3/startHibernation")
def test_nothing_is_reported_during_hibernation() -> None:
    bench = hibernating()

    bench.do(OperatingModeSwitched(OperatingMode.MANUAL), LinkReport(connected=True), TimePassed(NOON))
    assert not bench.effects

    bench.do(wake(), HAS_WOKEN)
    assert kinds(bench.effects) == [Wake, GoOnline, ReportState]
    assert bench.state.operating_mode is OperatingMode.MANUAL


@pytest.mark.clause("6.2.3/startHibernation")
@pytest.mark.parametrize("version", IN_3)
def test_stop_hibernation_wakes_the_robot_and_finishes_with_the_first_state(version: str) -> None:
    bench = hibernating(version)

    effects = bench.do(instant(action("i", "NONE", "stateRequest"), action("w", "NONE", "stopHibernation")))
    assert kinds(effects) == [LogIgnored, Wake]
    assert not bench.do(wake("w2"))
    assert bench.status("w") == "RUNNING"

    assert kinds(bench.do(HAS_WOKEN)) == [GoOnline, ReportState]
    assert (bench.status("w"), bench.status("w2"), bench.status("s")) == ("FINISHED",) * 3
    bench.do(instant(action("i", "NONE", "stateRequest")))
    assert bench.status("i") == "FINISHED"
    bench.send(order("n0", "n1", order_id="o2"))
    assert bench.goals


@pytest.mark.clause("6.2.3/startHibernation")
def test_a_robot_wakes_at_its_wake_up_time() -> None:
    bench = hibernating()

    assert not bench.do(TimePassed(SIX - timedelta(seconds=1)))
    assert bench.do(TimePassed(SIX)) == [Wake()]
    assert not bench.do(TimePassed(SIX + timedelta(seconds=1)))
    assert kinds(bench.do(HAS_WOKEN)) == [GoOnline, ReportState]
    assert bench.core.power is PowerPhase.AWAKE


@pytest.mark.parametrize("reach", [lambda _: None, lambda bench: bench.do(SignedOff(), HAS_SLEPT)])
def test_stop_hibernation_also_finishes_at_a_robot_that_is_awake(reach: Callable[[Bench], object]) -> None:
    bench = robot()
    reach(bench)

    bench.do(wake())

    assert bench.status("w") == "FINISHED"
    assert bench.core.power is PowerPhase.AWAKE


@pytest.mark.parametrize("stands", [True, False])
def test_stop_hibernation_revokes_a_hibernation_that_has_not_started(*, stands: bool) -> None:
    bench = robot()
    bench.send(order("n0", "n1"))
    bench.do(sleep())
    if stands:
        bench.halted()

    bench.do(wake(), SignedOff())
    bench.halted()

    assert bench.status("s") == ("FINISHED" if stands else "FAILED")
    assert bench.status("w") == "FINISHED"
    assert bench.core.power is PowerPhase.AWAKE
    assert not bench.effects_of(Hibernate)


def test_a_second_request_replaces_the_wake_up_time() -> None:
    bench = robot()
    bench.send(order("n0", "n1"))
    bench.do(sleep("first", "2026-01-01T13:00:00.000Z"), sleep("second"))

    bench.halted()

    assert (bench.status("first"), bench.status("second")) == ("FINISHED", "FINISHED")
    assert bench.do(SignedOff()) == [Hibernate(SIX)]


@pytest.mark.parametrize("stands", [True, False])
def test_a_wake_up_time_before_hibernation_keeps_the_robot_awake(*, stands: bool) -> None:
    bench = robot()
    bench.send(order("n0", "n1"))
    bench.do(sleep())
    if stands:
        bench.halted()

    bench.do(TimePassed(SIX), SignedOff())

    assert bench.status("s") == ("FINISHED" if stands else "FAILED")
    assert bench.core.power is PowerPhase.AWAKE
    assert not bench.effects_of(Hibernate)


def test_a_robot_whose_standstill_is_not_confirmed_stays_awake() -> None:
    bench = robot()
    bench.send(order("n0", "n1"))
    bench.do(sleep())

    bench.do(HaltFailed("odometry still shows 0.3 m/s"))

    assert bench.status("s") == "FAILED"
    assert bench.core.power is PowerPhase.AWAKE


FOREIGN = GoalReport("0a" * 16, external=True, status="executing")
MOVED = [VelocityReport(1.0, 0.0), VelocityReport(0.0, -0.5), GoalTable((FOREIGN,))]
"""A robot that moves without an order: by a joystick, by hand, by a goal of RViz."""
AT_REST = (VelocityReport(0.0, 0.0), GoalTable())


@pytest.mark.clause("6.2.3/startHibernation")
@pytest.mark.parametrize("motion", MOVED, ids=["drives", "turns", "foreign goal"])
def test_a_robot_that_moves_without_an_order_hibernates_at_standstill(motion: Event) -> None:
    bench = robot()
    bench.do(motion, sleep())
    assert (bench.status("s"), bench.core.power) == ("RUNNING", PowerPhase.FALLING_ASLEEP)
    bench.now += STANDSTILL_TIMEOUT - 0.1

    bench.do(TimePassed(), *AT_REST)

    assert bench.status("s") == "FINISHED"
    assert bench.do(SignedOff()) == [Hibernate(SIX)]


@pytest.mark.clause("6.2.3/startHibernation")
@pytest.mark.parametrize("motion", MOVED, ids=["drives", "turns", "foreign goal"])
def test_a_robot_that_does_not_stop_moving_stays_awake(motion: Event) -> None:
    bench = robot()
    bench.do(sleep("before"), wake())
    bench.now += 1000.0
    bench.do(motion, sleep())
    bench.now += STANDSTILL_TIMEOUT

    bench.do(TimePassed())

    assert (bench.status("s"), bench.core.power) == ("FAILED", PowerPhase.AWAKE)


@pytest.mark.clause("6.2.3/startHibernation")
@pytest.mark.parametrize("before", [True, False], ids=["before", "while the order ends"])
def test_instant_actions_end_before_the_robot_hibernates(*, before: bool) -> None:
    bench = robot()
    bench.send(order("n0", "n1"))
    begin = [instant(action("busy", "NONE", "press")), sleep()]
    bench.do(*(begin if before else reversed(begin)))
    bench.halted()
    assert (bench.status("s"), bench.core.power) == ("RUNNING", PowerPhase.FALLING_ASLEEP)

    bench.finishes("busy")

    assert bench.status("s") == "FINISHED"
    assert bench.do(SignedOff()) == [Hibernate(SIX)]


@pytest.mark.clause("6.2.3/startHibernation")
def test_an_instant_action_that_does_not_end_keeps_the_robot_awake() -> None:
    bench = robot()
    bench.do(instant(action("busy", "NONE", "press")), sleep())
    bench.now += STANDSTILL_TIMEOUT

    bench.do(TimePassed())

    assert (bench.status("s"), bench.core.power) == ("FAILED", PowerPhase.AWAKE)
    (shown,) = (each for each in bench.state.instant_action_states or () if each.action_id == "s")
    assert shown.action_result == "instant actions are running (press), for 30 s"


@pytest.mark.clause("6.2.3/startHibernation")
def test_a_wake_up_time_is_compared_with_the_clock_at_arrival() -> None:
    """The clock was a year ahead when the agent started, and was corrected since."""
    bench = robot()
    bench.do(TimePassed(NOON + timedelta(days=365)))

    bench.do(replace(sleep(), utc=NOON))

    assert bench.do(SignedOff()) == [Hibernate(SIX)]


@pytest.mark.clause("6.2.3/shutdown")
@pytest.mark.parametrize("name", ["startHibernation", "stopHibernation", "press", "stateRequest"])
def test_nothing_starts_after_a_shutdown_in_the_same_message(name: str) -> None:
    bench = robot()

    bench.instant(action("d", "NONE", "shutdown"), action("i", "NONE", name, wakeUpTime=AT_SIX))

    assert (bench.status("d"), bench.status("i")) == ("FINISHED", "FAILED")
    assert not bench.effects_of(StartAction)
    assert bench.do(SignedOff()) == [ShutDown()]


@pytest.mark.clause("6.2.3/shutdown")
def test_a_second_shutdown_finishes_at_once() -> None:
    bench = robot()

    bench.instant(action("d", "NONE", "shutdown"), action("d2", "NONE", "shutdown"))

    assert (bench.status("d"), bench.status("d2")) == ("FINISHED", "FINISHED")
    assert bench.do(SignedOff()) == [ShutDown()]


@pytest.mark.clause("6.2.3/shutdown")
@pytest.mark.parametrize("motion", MOVED, ids=["drives", "turns", "foreign goal"])
def test_a_robot_that_moves_without_an_order_does_not_shut_down(motion: Event) -> None:
    bench = robot()
    bench.do(motion)

    bench.do(shutdown())
    assert (bench.status("d"), bench.core.power) == ("FAILED", PowerPhase.AWAKE)

    bench.do(*AT_REST, instant(action("d2", "NONE", "shutdown")))
    assert bench.status("d2") == "FINISHED"


@pytest.mark.clause("6.2.3/startHibernation")
@pytest.mark.parametrize("stands", [True, False])
def test_a_journal_failure_before_hibernation_keeps_the_robot_awake(*, stands: bool) -> None:
    bench = robot()
    bench.send(order("n0", "n1"))
    bench.do(sleep())
    if stands:
        bench.halted()

    bench.do(JournalReport("no space left"), JournalReport(""))

    assert bench.status("s") == ("FINISHED" if stands else "FAILED")
    assert bench.core.power is PowerPhase.AWAKE


@pytest.mark.clause("6.2.3/startHibernation")
def test_a_robot_that_cannot_hibernate_wakes_and_reports_the_reason() -> None:
    bench = robot()
    bench.do(sleep(), SignedOff())

    effects = bench.do(PowerReport(PowerCommand.HIBERNATE, "sleep.sh ended with exit code 3"))
    assert effects == [Wake()]
    bench.do(HAS_WOKEN)

    (entry,) = bench.state.errors
    assert (entry.error_type, entry.error_level) == ("POWER_COMMAND_FAILED", "WARNING")
    assert "power.hibernate_command" in (entry.error_description or "")
    assert "exit code 3" in (entry.error_description or "")
    bench.send(order("n0", "n1"))
    assert not bench.errors


@pytest.mark.clause("6.2.3/startHibernation")
def test_a_robot_whose_wake_command_fails_is_awake() -> None:
    bench = hibernating()

    bench.do(wake(), PowerReport(PowerCommand.WAKE, "wake.sh did not end within 60 s"))

    assert bench.core.power is PowerPhase.AWAKE
    assert bench.status("w") == "FAILED"
    assert bench.errors == ["POWER_COMMAND_FAILED"]
    (shown,) = (each for each in bench.state.instant_action_states or () if each.action_id == "w")
    assert shown.action_result == "wake.sh did not end within 60 s"


@pytest.mark.clause("6.2.3/startHibernation", "6.6/restart")
@pytest.mark.parametrize(
    ("events", "phase", "effects"),
    [
        ((), PowerPhase.SIGNING_OFF, []),
        ((SignedOff(),), PowerPhase.HIBERNATING, []),
        ((SignedOff(), HAS_SLEPT), PowerPhase.HIBERNATING, []),
        ((SignedOff(), HAS_SLEPT, wake()), PowerPhase.WAKING, [Wake()]),
    ],
)
def test_a_restarted_agent_continues_to_hibernate(
    events: tuple[Event, ...], phase: PowerPhase, effects: list[object]
) -> None:
    bench = robot()
    bench.do(sleep(), *events)

    again = restarted(bench)
    again.effects.clear()
    again.do(Started(NOON))

    assert again.core.power is phase
    assert again.core.waits
    assert [each for each in again.effects if isinstance(each, Wake | Hibernate)] == effects
    if phase is PowerPhase.HIBERNATING:
        assert again.do(TimePassed(SIX)) == [Wake()]


@pytest.mark.clause("6.6/restart")
def test_a_restart_during_clearing_still_leads_to_hibernation() -> None:
    bench = robot()
    bench.send(order("n0", "n1"))
    bench.do(sleep())

    again = restarted(bench)
    again.halted()

    assert again.status("s") == "FINISHED"
    assert again.core.power is PowerPhase.SIGNING_OFF


@pytest.mark.parametrize("events", [(sleep(),), (sleep(), SignedOff()), (sleep(), SignedOff(), wake())])
def test_a_robot_whose_settings_no_longer_offer_hibernation_is_awake(events: tuple[Event, ...]) -> None:
    bench = robot()
    bench.do(*events)

    again = Bench(memory=bench.core.memory(), rules=RULES["3.0.1"])

    assert again.core.power is PowerPhase.AWAKE
    assert kinds(again.effects)[:2] == [GoOnline, ReportState]
    again.send(order("n0", "n1"))
    assert again.goals


@pytest.mark.clause("6.2.3/shutdown")
@pytest.mark.parametrize("version", IN_3)
def test_an_idle_robot_shuts_down_once_that_is_reported(version: str) -> None:
    bench = robot(version)

    assert kinds(bench.do(shutdown())) == [ReportState]
    assert bench.status("d") == "FINISHED"
    assert kinds(bench.do(OrderReceived(order("n0", "n1")))) == [LogIgnored]
    assert kinds(bench.do(wake())) == [LogIgnored, ReportState]
    assert bench.do(SignedOff()) == [ShutDown()]


@pytest.mark.clause("6.2.3/shutdown")
@pytest.mark.parametrize(
    "begin",
    [
        lambda bench: bench.send(order("n0", "n1")),
        lambda bench: bench.do(instant(action("busy"))),
        lambda bench: bench.do(instant(action("busy", "NONE", "press"))),
        lambda bench: (bench.send(order("n0", "n1")), bench.do(sleep())),
    ],
    ids=["order", "instant action", "one that cannot be cancelled", "about to hibernate"],
)
def test_a_robot_that_is_not_idle_does_not_shut_down(begin: Callable[[Bench], object]) -> None:
    bench = robot()
    begin(bench)

    bench.do(shutdown())

    assert bench.status("d") == "FAILED"
    assert "INVALID_INSTANT_ACTION" in bench.errors
    assert not bench.effects_of(ShutDown)


def test_a_robot_that_restarts_after_its_shutdown_is_awake() -> None:
    bench = robot()
    bench.do(shutdown(), SignedOff())

    again = restarted(bench)

    assert again.core.power is PowerPhase.AWAKE
    assert again.status("d") == "FINISHED"
    again.send(order("n0", "n1"))
    assert again.goals


def test_the_last_state_is_resent_over_a_new_connection() -> None:
    bench = robot()
    bench.do(sleep())

    assert kinds(bench.do(LinkReport(connected=False))) == []
    assert kinds(bench.do(LinkReport(connected=True))) == [ReportState]


@pytest.mark.parametrize("name", sorted(POWER_ACTIONS))
def test_power_actions_never_reach_a_plug_in(name: str) -> None:
    bench = robot()

    bench.instant(action("i", "NONE", name, wakeUpTime=AT_SIX))

    assert not bench.effects_of(StartAction)


EVENTS = st.sampled_from(
    [
        sleep(),
        sleep("s2", "2026-01-01T13:00:00.000Z"),
        wake(),
        wake("w2"),
        OrderReceived(order("n0", "n1")),
        instant(action("i", "NONE", "stateRequest")),
        instant(action("c", "NONE", "cancelOrder")),
        Halted(),
        HaltFailed("still moving"),
        SignedOff(),
        SignedOff(),
        HAS_SLEPT,
        PowerReport(PowerCommand.HIBERNATE, "exit code 1"),
        HAS_WOKEN,
        PowerReport(PowerCommand.WAKE, "exit code 1"),
        TimePassed(NOON + timedelta(minutes=90)),
        TimePassed(SIX),
        OperatingModeSwitched(OperatingMode.MANUAL),
        OperatingModeSwitched(OperatingMode.AUTOMATIC),
        None,
    ]
)
"""None: the agent is restarted."""


@pytest.mark.clause("6.2.3/startHibernation", "6.5")
@given(events=st.lists(EVENTS, max_size=25))
def test_a_hibernating_robot_is_silent_and_can_always_be_woken(
    events: list[Event | None],
) -> None:
    bench = robot()
    for event in events:
        slept = bench.core.power.silent
        effects = kinds(bench.do(event)) if event else []
        if event is None:
            bench = restarted(bench)
            effects = kinds(bench.effects)
        silent = bench.core.power.silent
        assert not silent or ReportState not in effects
        assert (Hibernate in effects) == (silent and not slept and event is not None)
        assert (GoOnline in effects) == (slept and not silent)
        if silent:
            assert not bench.nodes

    bench.do(OperatingModeSwitched(OperatingMode.AUTOMATIC), Halted(), SignedOff(), HAS_SLEPT)
    bench.do(wake("last"), HAS_WOKEN, Halted())
    assert bench.core.power is PowerPhase.AWAKE
    assert bench.status("last") == "FINISHED"
    assert all(each.status.ended for each in bench.core.robot.instant_actions)
