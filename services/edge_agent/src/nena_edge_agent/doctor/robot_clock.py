"""The clock: fleet control compares the times in messages, Nav2 those in poses."""

from __future__ import annotations

import ctypes

from nena_edge_agent.doctor.finding import Finding, Link, Verdict, missing, ok

MOST_OFF = 2.0
"""Seconds between this program's clock and the stamps of ROS that count as the same time."""

UNSYNCHRONISED = 5
"""What adjtimex(2) returns (TIME_ERROR) while nothing keeps the clock right."""

_TIMEX_SIZE = 512
"""Bytes, more than any Linux has in a timex; all zero asks and sets nothing."""


def kernel_keeps_time() -> bool | None:
    """Ask the kernel whether something (NTP, PTP) keeps the clock right; None where it cannot tell."""
    try:
        answer: int = ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(_TIMEX_SIZE))
    except (OSError, AttributeError):
        return None
    return None if answer < 0 else answer != UNSYNCHRONISED


def judge_clock(*, kept: bool | None, ros_offset: float | None) -> Finding:
    """Judge by what the kernel says and by how far ROS's stamps are ahead, in seconds."""
    if ros_offset is not None and abs(ros_offset) > MOST_OFF:
        return missing(
            Link.CLOCK,
            f"the robot's ROS messages are stamped {ros_offset:+.1f} s off this computer's clock",
            "synchronise both by NTP or PTP; on a real robot, use_sim_time must be false in every node",
        )
    if kept is False:
        return Finding(
            Link.CLOCK,
            Verdict.DOUBTFUL,
            "nothing keeps this computer's clock right, as far as the kernel knows",
            "have chrony or systemd-timesyncd keep it, by the same source as fleet control",
        )
    seen = "as ROS's stamps" if ros_offset is not None else "no stamp of ROS to compare it with"
    return ok(Link.CLOCK, f"{'synchronised' if kept else 'runs'}; {seen}")
