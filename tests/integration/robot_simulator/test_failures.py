"""What happens when the simulator itself fails."""

from __future__ import annotations

import asyncio

import pytest

from nena_robot_simulator.__main__ import _wait_for_stop
from nena_shared.tasks import TaskFailedError
from support.simulator import simulated_robot
from support.waiting import wait_until

pytestmark = pytest.mark.ros


async def test_unexpected_end_of_a_thread_ends_the_program(domain_id: int) -> None:
    with simulated_robot(domain_id) as robot:
        assert robot.alive
        robot._session._executor.create_task(lambda: 1 / 0)
        wait_until(lambda: not robot.alive, what="the end of the thread")
        with pytest.raises(TaskFailedError, match="a robot's ROS thread"):
            await _wait_for_stop([robot], asyncio.Event())
