"""Nav2's action spin in a separate process, ended as a test wants it, perhaps with a definition of its own.

It accepts each goal, writes a line when it is asked for the result, and ends the goal after a moment.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

MOMENT = 0.3
"""Seconds."""
TIMED_OUT = 701
"""Error code of a spin."""


def other_definition(folder: Path, definition: str) -> dict[str, str]:
    """Build nav2_msgs with another ``Spin.action``; return the environment of a process that uses it."""
    from nena_robot_simulator.interfaces import build  # noqa: PLC0415 - the process of the server needs none

    definitions, built = folder / "nav2_msgs", folder / "built"
    (definitions / "action").mkdir(parents=True)
    (definitions / "action" / "Spin.action").write_text(definition, encoding="utf-8")
    sources = build.generate(definitions, folder / "generated")
    build.build(sources, built)
    package = sources.of("rosidl_generator_py") / "nav2_msgs"
    shutil.copy(built / "nav2_msgs_s__rosidl_typesupport_c.so", package)
    (package / "__init__.py").touch()
    libraries = os.environ.get("LD_LIBRARY_PATH", "")
    return {"PYTHONPATH": str(package.parent), "LD_LIBRARY_PATH": f"{built}:{libraries}"}


@contextmanager
def spin_server(
    domain_id: int, status: str, *, result: str = "answers", environment: Mapping[str, str] | None = None
) -> Iterator[subprocess.Popen[str]]:
    """Run the server until the block ends; ``status``: how its goals end, such as ABORTED; "": never.

    ``result``: it ``answers`` with the result, has ``dropped`` it (``action_server_result_timeout``), or
    ``never`` sends one. ``silent``: it takes the goal, and its answer to that is lost as well.
    """
    command = [sys.executable, str(Path(__file__)), str(domain_id), status, result]
    variables = {**os.environ, **(environment or {})}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=variables) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "server ready\n"
            yield process
        finally:
            process.kill()


class _Server:
    def __init__(self, node: Any, status: str, result: str) -> None:
        from action_msgs.msg import GoalStatus, GoalStatusArray  # noqa: PLC0415 - in its own process alone
        from action_msgs.srv import CancelGoal  # noqa: PLC0415
        from nav2_msgs.action import Spin  # noqa: PLC0415
        from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: PLC0415

        self._result, self._types = result, Spin.Impl
        self._goal, self._array = GoalStatus(), GoalStatusArray
        self._asked: list[Any] = []
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._statuses = node.create_publisher(GoalStatusArray, "spin/_action/status", latched)
        goals = node.create_service(Spin.Impl.SendGoalService, "spin/_action/send_goal", self._take)
        if result == "silent":
            goals.send_response = lambda *_: None
        node.create_service(CancelGoal, "spin/_action/cancel_goal", self._cancel)
        results = node.create_service(
            Spin.Impl.GetResultService, "spin/_action/get_result", lambda _, made: made
        )
        self._send, results.send_response = results.send_response, self._ask  # so that it can be sent later
        node.create_timer(MOMENT, lambda: self._end(status))

    def _take(self, request: Any, response: Any) -> Any:
        self._goal.goal_info.goal_id = request.goal_id
        self._show("EXECUTING")
        response.accepted = True
        return response

    def _cancel(self, request: Any, response: Any) -> Any:
        self._end("CANCELED")
        response.goals_canceling = [request.goal_info]
        return response

    def _ask(self, _: Any, header: Any) -> None:
        self._asked.append(header)
        say("asked")
        self._answer()

    def _end(self, status: str) -> None:
        if status and self._goal.status == self._goal.STATUS_EXECUTING:
            self._show(status)
            self._answer()

    def _show(self, status: str) -> None:
        self._goal.status = getattr(self._goal, f"STATUS_{status}")
        self._statuses.publish(self._array(status_list=[self._goal]))

    def _answer(self) -> None:
        ended = self._goal.status >= self._goal.STATUS_SUCCEEDED
        while (
            self._asked and self._result not in {"never", "silent"} and (ended or self._result == "dropped")
        ):
            response = self._types.GetResultService.Response()
            if self._result == "answers":
                response.status = self._goal.status
                aborted = self._goal.status == self._goal.STATUS_ABORTED
                response.result.error_code = TIMED_OUT if aborted else 0
            self._send(response, self._asked.pop())


def say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def _main(domain_id: int, status: str, result: str) -> None:
    import rclpy  # noqa: PLC0415 - in the process of the server alone

    rclpy.init(domain_id=domain_id)
    node = rclpy.create_node("behavior_server")
    _Server(node, status, result)
    say("server ready")
    rclpy.spin(node)


if __name__ == "__main__":
    _main(int(sys.argv[1]), sys.argv[2], sys.argv[3])
