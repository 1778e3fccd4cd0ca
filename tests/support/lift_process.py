"""A lift in a separate process: a small ROS node that tests of actions use over DDS.

It obeys ``raise ... for <actionId>`` and ``lower ... for <actionId>`` on ``lift/command`` and answers on
``lift/result``, once discovery found a subscriber: an answer before that would be lost. ``stop`` makes it
forget its task. ``jam ...`` is answered by ``failed``, ``dream ...`` by
nothing. The service ``clamp`` closes and does not open; ``sleep`` never answers. ``lift/loaded`` has the
state of a sensor, ``lift/heard`` each received command.
"""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

DISCOVERY_CHECKS = 200
CHECK_EVERY = 0.05
"""In seconds."""


@contextmanager
def lift_process(domain_id: int, namespace: str = "") -> Iterator[subprocess.Popen[str]]:
    """Run the node until the block ends."""
    command = [sys.executable, str(Path(__file__)), str(domain_id), namespace]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "lift ready\n"
            yield process
        finally:
            process.kill()


def _main(domain_id: int, namespace: str) -> None:
    import rclpy  # noqa: PLC0415 - in the process of the node alone
    from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: PLC0415
    from std_msgs.msg import Bool, String  # noqa: PLC0415
    from std_srvs.srv import SetBool, Trigger  # noqa: PLC0415

    rclpy.init(domain_id=domain_id)
    node = rclpy.create_node("lift", namespace=namespace)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    results = node.create_publisher(String, "lift/result", 10)
    heard = node.create_publisher(String, "lift/heard", QoSProfile(depth=50))
    loaded = node.create_publisher(Bool, "lift/loaded", latched)

    def obey(message: Any) -> None:
        heard.publish(String(data=message.data))
        verb, _, rest = message.data.partition(" ")
        action_id = rest.rpartition(" ")[2]
        if verb in ("raise", "lower"):
            for _ in range(DISCOVERY_CHECKS):
                if results.get_subscription_count() > 0:
                    break
                threading.Event().wait(CHECK_EVERY)
            results.publish(String(data=f"at 50 % for {action_id}"))
            loaded.publish(Bool(data=verb == "raise"))
            results.publish(String(data=f"done {action_id}"))
        elif verb == "jam":
            results.publish(String(data=f"failed {action_id}"))

    def clamp(request: Any, response: Any) -> Any:
        response.success, response.message = request.data, "closed" if request.data else "the clamp is jammed"
        return response

    node.create_subscription(String, "lift/command", obey, 10)
    node.create_service(SetBool, "clamp", clamp)
    node.create_service(Trigger, "sleep", _sleep)
    sys.stdout.write("lift ready\n")
    sys.stdout.flush()
    rclpy.spin(node)


def _sleep(_: Any, response: Any) -> Any:
    threading.Event().wait()
    return response


if __name__ == "__main__":
    _main(int(sys.argv[1]), sys.argv[2])
