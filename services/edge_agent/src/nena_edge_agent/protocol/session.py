"""What the life of the robot's ROS session means for orders, and how the state tells of it."""

from __future__ import annotations

from functools import lru_cache

from nena_edge_agent.driver.port import SessionReport
from nena_edge_agent.protocol.parts import RobotParts
from nena_edge_agent.ros.session_state import SessionState
from nena_shared.vda5050.error import ErrorReference
from nena_shared.vda5050.own_actions import CONFIGURE_ROS_SESSION, ROS_SESSION, STOP_ROS_SESSION
from nena_shared.vda5050.state import InfoLevel, Information

OFF = frozenset({SessionState.NOT_ACTIVE, SessionState.TERMINATING})
"""Somebody wants the session to be off; in the other states it is there, or about to be."""
SWITCHING = (STOP_ROS_SESSION, CONFIGURE_ROS_SESSION)


def switched_off(parts: RobotParts) -> str:
    """Say why the session keeps the robot from taking orders; empty if it does not.

    One that has failed does not: it is started again by itself, and an order waits for that.
    """
    session = parts.senses.session
    if session is None:
        return ""
    if session.state in OFF:
        return "its ROS session is not active"
    return "its ROS session is being switched" if any(map(parts.instants_running, SWITCHING)) else ""


@lru_cache(maxsize=64)
def session_information(session: SessionReport | None) -> tuple[Information, ...]:
    """Tell people of the session; a robot without ROS has none."""
    if session is None:
        return ()
    facts = {"state": session.state.value, "namespace": session.namespace, "domainId": str(session.domain_id)}
    text = f"the ROS session is {session.state}"
    return (
        Information(
            info_type=ROS_SESSION,
            info_level=InfoLevel.INFO,
            info_references=tuple(
                ErrorReference(reference_key=key, reference_value=value) for key, value in facts.items()
            ),
            info_descriptor=f"{text}: {session.reason}" if session.reason else text,
        ),
    )
