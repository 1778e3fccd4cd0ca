from __future__ import annotations

import asyncio

from nena_edge_agent.driver.port import Arrived, BatteryReport, DriveProgress
from nena_edge_agent.mailbox import MESSAGE_LIMIT, Mailbox
from nena_edge_agent.protocol.events import OrderReceived, Started
from support.robot_core import at, order
from support.waiting import PATIENCE


def test_events_come_out_in_their_order_and_once() -> None:
    mailbox = Mailbox()
    for event in (Started(), Arrived(1), Started()):
        mailbox.put(event)

    assert mailbox.take() == [Started(), Arrived(1), Started()]
    assert mailbox.take() == []
    assert mailbox.empty


def test_of_poses_battery_reports_and_progress_only_the_newest_waits() -> None:
    mailbox = Mailbox()
    for number in range(5):
        mailbox.put(at(float(number)))
        mailbox.put(BatteryReport(state_of_charge=float(number), charging=False))
        mailbox.put(DriveProgress(float(number), 0, "map"))

    newest = [at(4.0), BatteryReport(state_of_charge=4.0, charging=False), DriveProgress(4.0, 0, "map")]
    assert mailbox.take() == newest


def test_a_pose_stays_before_the_arrival_that_it_proves() -> None:
    mailbox = Mailbox()
    for event in (at(1.0), at(2.0), Arrived(1), at(3.0)):
        mailbox.put(event)

    assert mailbox.take() == [at(2.0), Arrived(1), at(3.0)]


def test_messages_beyond_the_limit_are_dropped_and_counted_and_answers_never() -> None:
    mailbox = Mailbox()
    for number in range(MESSAGE_LIMIT + 3):
        mailbox.put(OrderReceived(order("n0", update=number)))
        mailbox.put(Arrived(number))

    taken = mailbox.take()
    assert sum(isinstance(event, OrderReceived) for event in taken) == MESSAGE_LIMIT
    assert sum(isinstance(event, Arrived) for event in taken) == MESSAGE_LIMIT + 3
    assert mailbox.dropped == 3
    mailbox.put(OrderReceived(order("n0")))
    assert len(mailbox.take()) == 1


async def test_a_wait_ends_with_an_event_or_with_its_time() -> None:
    mailbox = Mailbox()
    await mailbox.wait(0.01)
    assert mailbox.empty

    asyncio.get_running_loop().call_soon(mailbox.put, Started())
    await asyncio.wait_for(mailbox.wait(600.0), PATIENCE)
    assert mailbox.take() == [Started()]

    mailbox.wake()
    await asyncio.wait_for(mailbox.wait(600.0), PATIENCE)
    assert mailbox.take() == []
