"""What Nav2's error codes mean, and what to do about them."""

from __future__ import annotations

from typing import NamedTuple

SEVERAL = 100
"""Offset of the planner's codes for a route through several poses."""


class Meaning(NamedTuple):
    """Why a goal failed, and a hint for fixing it; "": the default hint."""

    reason: str
    hint: str = ""


_NO_TRANSFORM = "check localisation and clocks on the robot, and set its position"
_SETTINGS = "compare the names in Nav2's behaviour tree with the plug-ins in its parameters"
_INSIDE_OBSTACLE = "clear the area, or move the robot out by hand and check its position on the map"
_NO_PATH = (
    "clear the path, and compare the position with the map; Nav2 keeps obstacles until it sees them gone"
)
_MEANINGS = {
    100: Meaning("the controller reported no reason", "check the log of controller_server on the robot"),
    101: Meaning("Nav2 has no such controller", _SETTINGS),
    102: Meaning("the controller lacks a transform", _NO_TRANSFORM),
    103: Meaning("the controller cannot use the path", "check the log of controller_server on the robot"),
    104: Meaning("the controller stopped waiting", "clear the robot's path"),
    105: Meaning("the robot makes no progress", "clear its path; check brakes, emergency stop and motors"),
    106: Meaning("the controller found no valid command", "clear the robot's path"),
    107: Meaning("the controller is too slow", "check the load of the robot's computer"),
    200: Meaning("the planner reported no reason", "check the log of planner_server on the robot"),
    201: Meaning("Nav2 has no such planner", _SETTINGS),
    202: Meaning("the planner lacks a transform", _NO_TRANSFORM),
    203: Meaning("the robot is outside of the map", "set the robot's position, and check its map"),
    204: Meaning("the goal is outside of the map", "compare the plant model with the robot's map"),
    205: Meaning("the robot's position is occupied on the map", _INSIDE_OBSTACLE),
    206: Meaning("the goal is occupied", "clear the goal, or compare the plant model with the map"),
    207: Meaning("the planner is too slow", "check the load of the robot's computer"),
    208: Meaning("no path leads to the goal", _NO_PATH),
    309: Meaning("the goal has no poses"),
    901: Meaning("the docking server does not know this dock", "name a dock of its database"),
    902: Meaning("the docking server cannot use this dock", "check the dock's type and pose in its database"),
    903: Meaning("the robot did not reach the staging pose of the dock", "clear the path to the dock"),
    904: Meaning("the dock was not found", "check that the robot can detect it and that nothing hides it"),
    905: Meaning(
        "the robot could not be steered into the dock", "clear the dock, and check the robot's path"
    ),
    906: Meaning("the robot is docked but not charging", "check the dock's power and contacts"),
    907: Meaning("docking took too long", "clear the dock, and check the robot's path"),
    999: Meaning("the docking server reported no reason", "check the log of docking_server on the robot"),
}
_FAMILIES = {
    500: "the smoother has failed",
    600: "missed a waypoint",
    700: "a recovery has failed",
    900: "docking has failed",
    9000: "the navigator has failed",
}
"""Ranges of codes, by their first one, whose specific meanings do not help a person at the robot."""
TRANSIENT = frozenset({0, 102, 107, 202, 207, 302, 307})
"""Codes of aborts whose cause is likely to pass.

Nav2 gives none if it is deactivated or a server does not answer in time (107, 207 or 307 after Jazzy), and
102, 202 or 302 while a transform is missing, as in the second after the localisation's first pose.
"""
_UNKNOWN = "unknown Nav2 error code"


def meaning_of(code: int, message: str = "") -> Meaning | None:
    """Return the meaning of an ``error_code``, with Nav2's own ``error_msg``; None: no reason."""
    if not code and not message:
        return None
    meaning = _MEANINGS.get(code)
    if meaning is None and code // SEVERAL == 3:  # noqa: PLR2004 - 3xx: see SEVERAL
        meaning = _MEANINGS.get(code - SEVERAL)
    family = next((text for first, text in reversed(_FAMILIES.items()) if code >= first), _UNKNOWN)
    text, hint = meaning or Meaning(family)
    return Meaning(f"{text} (error code {code}{f': {message}' if message else ''})", hint)
