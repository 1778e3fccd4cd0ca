"""The connection message of 2.1 (section 6.14)."""

from __future__ import annotations

from typing import Annotated

from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.v2_1.base import TimestampV2
from nena_shared.vda5050.wire_names import reads, writes

ConnectionStateV21 = Annotated[
    ConnectionState,
    reads({"CONNECTIONBROKEN": "CONNECTION_BROKEN"}),
    writes({"CONNECTION_BROKEN": "CONNECTIONBROKEN", "HIBERNATING": "ONLINE"}, ConnectionState),
]


class ConnectionV21(Connection):
    """CONNECTION_BROKEN without the underscore; a hibernating robot is still connected."""

    timestamp: TimestampV2
    connection_state: ConnectionStateV21
