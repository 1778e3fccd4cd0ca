"""Why Nav2 says that a drive has failed: the error codes in the results of its actions (Jazzy)."""

from __future__ import annotations

_REASONS = {
    100: "the controller gives no reason",
    101: "Nav2 has no such controller",
    102: "the controller misses a transform",
    103: "the controller cannot use the path",
    104: "the controller's patience is at its end",
    105: "the robot does not get on",
    106: "the controller finds no way to move",
    107: "the controller takes too long",
    200: "the planner gives no reason",
    201: "Nav2 has no such planner",
    202: "the planner misses a transform",
    203: "the robot is outside of the map",
    204: "the place is outside of the map",
    205: "the robot stands in what the map has as occupied",
    206: "the place is occupied",
    207: "the planner takes too long",
    208: "there is no way to the place",
    309: "the goal names no places",
}
_FAMILIES = {
    500: "the smoother has failed",
    600: "a waypoint was missed",
    700: "a recovery has failed",
    900: "docking has failed",
    9000: "the navigator has failed",
}
"""Codes from these on whose single meanings help nobody who stands beside the robot."""
SEVERAL = 100
"""What a code of the planner is higher by, where a way over several places was asked for."""


def reason_of(code: int, message: str = "") -> str | None:
    """Say in words what an ``error_code`` means, with Nav2's own ``error_msg``; None: it gives no reason."""
    if not code and not message:
        return None
    known = _REASONS.get(code) or (_REASONS.get(code - SEVERAL) if code // SEVERAL == 3 else None)  # noqa: PLR2004 - 3xx: see SEVERAL
    family = next((text for first, text in reversed(_FAMILIES.items()) if code >= first), None)
    text = known or family or "Nav2 gives a code that this program does not know"
    return f"{text} (error code {code}{f': {message}' if message else ''})"
