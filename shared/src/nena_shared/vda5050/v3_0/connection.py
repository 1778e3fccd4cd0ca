"""The connection message of 3.0 (section 7.7)."""

from __future__ import annotations

from typing import Annotated

from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.wire_names import reads


class ConnectionV30(Connection):
    """What is known of a robot's MQTT link; the schema's description still has the name of 2.x."""

    connection_state: Annotated[ConnectionState, reads({"CONNECTIONBROKEN": "CONNECTION_BROKEN"})]
