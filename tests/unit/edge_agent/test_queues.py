from __future__ import annotations

import asyncio
from math import inf

import pytest

from nena_edge_agent.driver.port import Arrived, BatteryReport, DriveGoal, DriveProgress, Pose
from nena_edge_agent.protocol.events import (
    CancelAction,
    Drive,
    Effect,
    Halt,
    OrderReceived,
    PauseAction,
    ReportState,
    StartAction,
    Started,
)
from nena_edge_agent.queues import MESSAGE_LIMIT, Mailbox, Postponed, StateSchedule, VisualizationSchedule
from support.robot_core import action, at, order
from support.waiting import PATIENCE


def test_events_are_taken_once_and_in_order() -> None:
    mailbox = Mailbox()
    for event in (Started(), Arrived(1), Started()):
        mailbox.put(event)

    assert mailbox.take_all() == [Started(), Arrived(1), Started()]
    assert mailbox.take_all() == []
    assert mailbox.is_empty


def test_only_the_newest_pose_battery_report_and_progress_is_queued() -> None:
    mailbox = Mailbox()
    for number in range(5):
        mailbox.put(at(float(number)))
        mailbox.put(BatteryReport(state_of_charge=float(number), charging=False))
        mailbox.put(DriveProgress(float(number), 0, "map"))

    newest = [at(4.0), BatteryReport(state_of_charge=4.0, charging=False), DriveProgress(4.0, 0, "map")]
    assert mailbox.take_all() == newest


def test_a_pose_is_delivered_before_the_arrival_that_it_confirms() -> None:
    mailbox = Mailbox()
    for event in (at(1.0), at(2.0), Arrived(1), at(3.0)):
        mailbox.put(event)

    assert mailbox.take_all() == [at(2.0), Arrived(1), at(3.0)]


def test_messages_beyond_the_limit_are_dropped_and_counted_but_reports_never_are() -> None:
    mailbox = Mailbox()
    for number in range(MESSAGE_LIMIT + 3):
        mailbox.put(OrderReceived(order("n0", update=number)))
        mailbox.put(Arrived(number))

    taken = mailbox.take_all()
    assert sum(isinstance(event, OrderReceived) for event in taken) == MESSAGE_LIMIT
    assert sum(isinstance(event, Arrived) for event in taken) == MESSAGE_LIMIT + 3
    assert mailbox.dropped == 3
    mailbox.put(OrderReceived(order("n0")))
    assert len(mailbox.take_all()) == 1


async def test_a_wait_ends_with_an_event_or_its_timeout() -> None:
    mailbox = Mailbox()
    await mailbox.wait(0.01)
    assert mailbox.is_empty

    asyncio.get_running_loop().call_soon(mailbox.put, Started())
    await asyncio.wait_for(mailbox.wait(600.0), PATIENCE)
    assert mailbox.take_all() == [Started()]

    mailbox.wake()
    await asyncio.wait_for(mailbox.wait(600.0), PATIENCE)
    assert mailbox.take_all() == []


DRIVE = Drive(DriveGoal(1, Pose(1.0, 0.0, 0.0, "hall"), 0.5))
OTHER = Drive(DriveGoal(2, Pose(2.0, 0.0, 0.0, "hall"), 0.5))
LOAD, LIFT = (StartAction(action(name), ()) for name in ("load", "lift"))


def test_recorded_effects_are_performed_at_once_in_order() -> None:
    effects: list[Effect] = [Halt(), DRIVE, LOAD, ReportState()]
    assert Postponed().select_ready(effects, recorded=True) == effects


def test_starts_wait_for_the_record() -> None:
    postponed = Postponed()
    assert postponed.select_ready([DRIVE, LOAD, ReportState()], recorded=False) == [ReportState()]
    assert postponed.select_ready([LIFT], recorded=False) == []
    assert postponed.select_ready([OTHER], recorded=True) == [DRIVE, LOAD, LIFT, OTHER]
    assert postponed.select_ready([], recorded=True) == []


def test_stops_are_never_postponed_and_cancel_waiting_starts() -> None:
    postponed = Postponed()
    postponed.select_ready([DRIVE, LOAD, LIFT], recorded=False)
    ends: list[Effect] = [Halt(), CancelAction("load"), PauseAction("lift")]
    assert postponed.select_ready(ends, recorded=False) == ends
    assert postponed.select_ready([], recorded=True) == [LIFT]


def test_the_first_state_is_due_at_once() -> None:
    assert StateSchedule(minimum=0.5, maximum=30.0).due == -inf


@pytest.mark.clause("6.6.1/interval")
def test_without_a_trigger_the_next_state_is_sent_after_the_maximum_interval() -> None:
    schedule = StateSchedule(minimum=0.5, maximum=30.0)
    schedule.record_sent(100.0)

    assert schedule.due == 130.0


@pytest.mark.clause("6.6.1/interval")
def test_a_state_is_due_on_request_after_the_minimum_interval() -> None:
    schedule = StateSchedule(minimum=0.5, maximum=30.0)
    schedule.record_sent(100.0)

    schedule.request(100.1)
    schedule.request(100.2)
    assert schedule.due == 100.5
    schedule.record_sent(100.5)
    assert schedule.due == 130.5

    schedule.request(110.0)
    schedule.request(111.0)
    assert schedule.due == 110.0


@pytest.mark.clause("6.7")
def test_visualization_keeps_its_rate_and_skips_missed_messages() -> None:
    schedule = VisualizationSchedule(interval=2.0, now=100.0)
    assert schedule.due == 100.0

    schedule.record_sent(100.3)
    assert schedule.due == 102.0
    schedule.record_sent(109.0)
    assert schedule.due == 109.0


@pytest.mark.clause("6.7")
def test_an_interval_of_0_disables_visualization() -> None:
    assert VisualizationSchedule(interval=0.0, now=100.0).due == inf
