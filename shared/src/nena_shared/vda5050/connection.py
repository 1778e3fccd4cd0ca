"""The connection message (VDA 5050 3.0 sections 6.5 and 7.7)."""

from __future__ import annotations

from enum import StrEnum

from nena_shared.vda5050.base import Header


class ConnectionState(StrEnum):
    """State of a robot's MQTT connection; says nothing about the robot's health (section 6.5)."""

    ONLINE = "ONLINE"
    OFFLINE = "OFFLINE"
    HIBERNATING = "HIBERNATING"
    CONNECTION_BROKEN = "CONNECTION_BROKEN"


class Connection(Header):
    """Connection state, retained, QoS 1. CONNECTION_BROKEN is the robot's last will (section 6.5)."""

    connection_state: ConnectionState
