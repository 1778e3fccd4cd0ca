"""The types of Nav2's actions, where this machine has them."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from nena_robot_simulator.action import Action

_NAMES = {Action.TO_POSE: "NavigateToPose", Action.THROUGH_POSES: "NavigateThroughPoses"}


def action_types() -> dict[Action, Any]:
    """Give the type of each action; none at all where ``nav2_msgs`` is missing."""
    try:
        module = import_module("nav2_msgs.action")
    except ImportError:
        return {}
    return {action: getattr(module, name) for action, name in _NAMES.items()}
