"""Simulated robots for tests, in this process or as a separate program."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

import psutil
from action_msgs.msg import GoalStatusArray
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from std_srvs.srv import Trigger

from nena_robot_simulator.messages import pose_message
from nena_robot_simulator.motion import Pose, hall
from nena_robot_simulator.node import RobotNode
from nena_robot_simulator.settings import RobotSettings, SimulatorSettings
from nena_shared.clock import SystemClock
from support.ros import RosPeer
from support.waiting import PATIENCE, STARTUP, wait_until

PROGRAMS = Path(sys.executable).parent
"""Folder of the simulator's console script."""
HALL = hall(min_x=-20, min_y=-20, max_x=40, max_y=40, resolution=0.2)


@contextmanager
def simulated_robot(
    domain_id: int,
    namespace: str = "",
    *,
    time_factor: float = 5.0,
    result_timeout: float = 900.0,
    recovery_time: float = 0.0,
    actions: bool = True,
    **robot: Any,
) -> Iterator[RobotNode]:
    """Run one robot in a thread of this process; ``robot`` are fields of its settings."""
    settings = RobotSettings(domain_id=domain_id, namespace=namespace, **robot)
    node = RobotNode(
        settings,
        simulator=SimulatorSettings(
            time_factor=time_factor,
            result_timeout=result_timeout,
            recovery_time=recovery_time,
            actions=actions,
        ),
        hall=HALL,
        clock=SystemClock(),
    )
    node.start()
    try:
        yield node
    finally:
        node.close()


def publisher_to(peer: RosPeer, kind: Any, topic: str, namespace: str = "") -> Any:
    """Return a publisher that the robot in ``namespace`` has already discovered.

    Best-effort readers such as ``goal_pose`` lose what is sent before *their* end has matched, and only they
    know. Discovery announces a node's endpoints in the order in which they were made, so the answer to a
    client that was made later shows that the robot has discovered the publisher.
    """
    prefix = f"/{namespace}/" if namespace else "/"
    publisher = peer.publisher(kind, prefix + topic)
    heard(peer, namespace)
    return publisher


def heard(peer: RosPeer, namespace: str = "") -> None:
    """Wait until the robot in ``namespace`` has handled ``peer``'s messages and found its subscriptions.

    It answers one after the other, and discovers a node's endpoints in the order in which they were made.
    """
    prefix = f"/{namespace}/" if namespace else "/"
    peer.call(peer.client(Trigger, f"{prefix}lifecycle_manager_navigation/is_active"), Trigger.Request())


def goal(x: float, y: float, yaw: float = 0.0, frame: str = "map") -> Any:
    """Make a goal for ``goal_pose``: metres and radians."""
    message = PoseStamped(pose=pose_message(Pose(x, y, yaw)))
    message.header.frame_id = frame
    return message


def initial_pose(x: float, y: float, yaw: float = 0.0, frame: str = "map") -> Any:
    """Make a message for ``initialpose``: metres and radians."""
    message = PoseWithCovarianceStamped()
    message.header.frame_id = frame
    message.pose.pose = pose_message(Pose(x, y, yaw))
    return message


def trace(arrays: list[GoalStatusArray]) -> list[str]:
    """Write status arrays as ``A:6 B:2``, the goals lettered in the order in which they were first seen."""
    letters: dict[bytes, str] = {}
    lines = []
    for array in arrays:
        ids = [bytes(entry.goal_info.goal_id.uuid) for entry in array.status_list]
        for goal_id in ids:
            letters.setdefault(goal_id, chr(ord("A") + len(letters)))
        lines.append(
            " ".join(f"{letters[i]}:{e.status}" for i, e in zip(ids, array.status_list, strict=True))
        )
    return lines


class SimulatorProcess:
    """The simulator's program, started by its console script and killed at the end of the context."""

    def __init__(self, *arguments: str, directory: Path) -> None:
        environment = {**os.environ, "TMPDIR": str(directory)}
        environment.pop("ROS_LOG_DIR", None)
        self.lines: list[str] = []
        self._process = subprocess.Popen(
            [str(PROGRAMS / "nena-robot-simulator"), *arguments],
            env=environment,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._reader = threading.Thread(target=self._read, name="simulator output", daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stderr is not None
        self.lines.extend(self._process.stderr)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process.poll() is None:
            self._process.kill()
        self.ended()
        assert self._process.stderr is not None
        self._process.stderr.close()

    def wait_for_line(self, *parts: str, timeout: float = STARTUP) -> None:
        """Wait until one line of the log contains all ``parts``."""
        wait_until(
            lambda: any(all(part in line for part in parts) for line in list(self.lines)),
            timeout=timeout,
            what=f"a line with {parts}",
        )

    def stop(self, with_signal: signal.Signals) -> None:
        self._process.send_signal(with_signal)

    @property
    def frozen(self) -> bool:
        """Return whether SIGSTOP has taken effect."""
        return bool(psutil.Process(self._process.pid).status() == psutil.STATUS_STOPPED)

    def ended(self, timeout: float = PATIENCE) -> int:
        """Wait until the program has exited, and return its exit status."""
        status = self._process.wait(timeout)
        self._reader.join(timeout)
        return status
