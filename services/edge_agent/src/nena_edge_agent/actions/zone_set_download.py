"""downloadZoneSet (section 6.2.3)."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from functools import partial
from typing import Any

from nena_edge_agent.actions.background import BackgroundAction, WorkFailedError
from nena_edge_agent.actions.plugin import Report, RunningAction
from nena_edge_agent.download import DownloadError, DownloadSettings, download
from nena_edge_agent.protocol.declaration import DOWNLOAD_ZONE_SET, ActionDeclaration, Parameter
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.state import Load
from nena_shared.vda5050.zone_set import ZoneSet, ZoneSetTransfer

ZONE_SET_LINK = "zoneSetDownloadLink"
ZONE_SET_HASH = "zoneSetHash"
ENVELOPE = "zoneSet"


class ZoneSetDownload:
    """Fetches a zone set: the standard's zoneSet object as JSON, alone or in a whole message."""

    declaration = ActionDeclaration(
        DOWNLOAD_ZONE_SET,
        scopes=(ActionScope.INSTANT,),
        parameters=(
            Parameter("zoneSetId", ValueDataType.STRING),
            Parameter(ZONE_SET_LINK, ValueDataType.STRING, description="http or https"),
            Parameter(
                ZONE_SET_HASH, ValueDataType.STRING, required=False, description="SHA-256, hexadecimal"
            ),
        ),
        restartable=True,
        description="Fetches a zone set.",
    )

    def __init__(self, codec: Codec, settings: DownloadSettings) -> None:
        self._codec = codec
        self._settings = settings

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Begin to fetch; the core takes what was fetched, or fails the action."""
        return BackgroundAction(action.action_id, partial(self._work, action), report)

    async def _work(self, action: Action) -> ActionReport:
        digest = action.parameter(ZONE_SET_HASH)
        link = str(action.parameter(ZONE_SET_LINK))
        try:
            content = await download(link, None if digest is None else str(digest), self._settings)
            zone_set = self._read(content)
        except (DownloadError, MalformedMessageError, ValueError) as error:
            raise WorkFailedError(str(error)) from error
        if zone_set.zone_set_id != action.parameter("zoneSetId"):
            message = f"{link} holds the zone set '{zone_set.zone_set_id}'"
            raise WorkFailedError(message)
        return ActionReport(action.action_id, ActionStatus.FINISHED, zone_set=zone_set)

    def _read(self, content: bytes) -> ZoneSet:
        """Read it as if it had come as a message, whatever the header says.

        Raises:
            ValueError: it is no JSON.
            MalformedMessageError: it is no zone set.

        """
        found = _parsed(content)
        inner = found.get(ENVELOPE, found) if isinstance(found, dict) else found
        header = {
            "headerId": 0,
            "timestamp": datetime.now(UTC).isoformat(),
            "version": self._codec.version,
            "manufacturer": "",
            "serialNumber": "",
        }
        message = json.dumps(header | {ENVELOPE: inner}).encode()
        return self._codec.decode(ZoneSetTransfer, message).zone_set


def _parsed(content: bytes) -> Any:  # noqa: ANN401 - anything that JSON holds
    """Read JSON in any of its encodings.

    Raises:
        ValueError: it is none.

    """
    try:
        return json.loads(content)
    except RecursionError as error:
        message = "objects or arrays are nested too deep"
        raise ValueError(message) from error
