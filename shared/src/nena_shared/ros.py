"""ROS 2 basics for edge agent and robot simulator. Can be imported without ROS."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from enum import IntEnum
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rclpy.context import Context

NORM_TOLERANCE = 0.01
"""Tolerance for the length of a unit quaternion."""


class GoalStatus(IntEnum):
    """action_msgs/GoalStatus."""

    UNKNOWN = 0
    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6

    @classmethod
    def of(cls, number: int) -> GoalStatus:
        """Return the status for a number on the wire; UNKNOWN for undefined numbers."""
        try:
            return cls(number)
        except ValueError:
            return cls.UNKNOWN

    @property
    def terminal(self) -> bool:
        """Whether the goal has ended; no other status follows."""
        return self >= GoalStatus.SUCCEEDED


def interface(name: str) -> Any | None:  # noqa: ANN401 - rclpy carries no types
    """Return the type named, for example, ``nav2_msgs/msg/SpeedLimit``; None if it is not installed."""
    package, kind, type_name = name.split("/")
    try:
        return getattr(import_module(f"{package}.{kind}"), type_name, None)
    except ImportError:
        return None


GENERATOR = "rosidl_generator_py.generate_py_impl"


def _import_without_generator() -> None:
    """Import the package that loads the type support of messages, but not its code generator (9 MB).

    The package imports the generator too, and goes on without it if that fails.
    """
    if "rosidl_generator_py" in sys.modules:
        return
    sys.modules[GENERATOR] = None  # type: ignore[assignment] # documented: this import fails
    try:
        with suppress(ImportError):
            import_module("rosidl_generator_py")
    finally:
        sys.modules.pop(GENERATOR, None)  # another thread may have been faster


@contextmanager
def joined_domain(domain_id: int) -> Iterator[Context]:
    """Join a ROS domain with a separate context; destroy its nodes before the end of the block."""
    import rclpy  # noqa: PLC0415 - see the module's docstring
    from rclpy.context import Context  # noqa: PLC0415
    from rclpy.signals import SignalHandlerOptions  # noqa: PLC0415

    _import_without_generator()
    context = Context()
    # the program handles signals itself (`tasks.stop_on_signals`)
    rclpy.init(args=[], context=context, domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield context
    finally:
        context.try_shutdown()


def wrap(angle: float) -> float:
    """Normalise an angle (rad) to (-pi, pi]."""
    return math.pi - (math.pi - angle) % math.tau


def yaw_of(x: float, y: float, z: float, w: float) -> float | None:
    """Return the yaw (rad) of a unit quaternion of either sign; None if it is not a unit quaternion."""
    norm = math.hypot(x, y, z, w)
    if not math.isfinite(norm) or abs(norm - 1.0) > NORM_TOLERANCE:
        return None
    return wrap(math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
