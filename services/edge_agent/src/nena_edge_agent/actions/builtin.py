"""Built-in actions: wait, downloadZoneSet, map transforms, behaviour trees and timed operations.

``make_registry`` in ``program`` decides which of them a robot has.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from typing import Any

from nena_edge_agent.actions.plugin import (
    ENDED,
    BackgroundAction,
    Countdown,
    Report,
    RunningAction,
    WorkFailedError,
)
from nena_edge_agent.actions.settings import OperationSettings
from nena_edge_agent.download import DownloadError, DownloadSettings, download
from nena_edge_agent.protocol.declaration import DOWNLOAD_ZONE_SET, ActionDeclaration, Parameter
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action, ActionStatus, BlockingType
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.own_actions import BEHAVIOR_TREE, SHOW_MAP_TRANSFORMS, USE_BEHAVIOR_TREE
from nena_shared.vda5050.state import Load
from nena_shared.vda5050.zone_set import ZoneSet, ZoneSetTransfer

LONGEST = 86_400.0
"""Maximum duration, seconds."""


class Wait:
    """Finishes after its parameter ``duration``, s."""

    declaration = ActionDeclaration(
        "wait",
        scopes=(ActionScope.NODE, ActionScope.EDGE, ActionScope.INSTANT),
        parameters=(
            Parameter("duration", ValueDataType.NUMBER, description="s", minimum=0.0, maximum=LONGEST),
        ),
        pause_allowed=True,
        cancel_allowed=True,
        restartable=True,
        description="Waits.",
    )

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Start the countdown."""
        value = action.parameter("duration")
        seconds = float(value) if isinstance(value, int | float) else 0.0
        end = ActionReport(action.action_id, ActionStatus.FINISHED)
        return Countdown(action.action_id, seconds, report, partial(report, end)).start()


class TimedOperation:
    """Takes the configured time, then picks up or drops the load."""

    def __init__(self, settings: OperationSettings) -> None:
        self._settings = settings
        self.declaration = ActionDeclaration(
            settings.action_type,
            parameters=tuple(parameter.declared for parameter in settings.parameters),
            scopes=settings.scopes,
            blocking_types=settings.blocking_types,
            pause_allowed=settings.interruptible,
            cancel_allowed=settings.interruptible,
            restartable=True,
            load=settings.load_change,
            description=settings.description or f"Takes {settings.seconds:g} s.",
        )

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Start the countdown."""
        end = ActionReport(action.action_id, ActionStatus.FINISHED, charging=self._settings.charging)
        return Countdown(action.action_id, self._settings.seconds, report, partial(report, end)).start()


# 0019: a factsheet that lists this action tells fleet control that the robot transforms, not the fleet.
class MapTransforms:
    """Returns the configured map transforms as the action's result."""

    declaration = ActionDeclaration(
        SHOW_MAP_TRANSFORMS,
        scopes=(ActionScope.INSTANT,),
        restartable=True,
        description="Returns the transforms from the plant to the robot's maps; the robot applies them.",
    )

    def __init__(self, texts: Mapping[str, str]) -> None:
        """Report ``texts``, the transform of each map ID."""
        self._result = "; ".join(f"{map_id}: {text}" for map_id, text in sorted(texts.items()))

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Report the result at once."""
        report(ActionReport(action.action_id, ActionStatus.FINISHED, self._result))
        return ENDED


ZONE_SET_LINK = "zoneSetDownloadLink"
ZONE_SET_HASH = "zoneSetHash"
ENVELOPE = "zoneSet"


class ZoneSetDownload:
    """Downloads a zone set as JSON: a zoneSet object, or a whole message (VDA 5050 3.0 section 6.2.3)."""

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
        description="Downloads a zone set.",
    )

    def __init__(self, codec: Codec, settings: DownloadSettings) -> None:
        self._codec = codec
        self._settings = settings

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Start the download; the core accepts the content, or fails the action."""
        return BackgroundAction(action.action_id, partial(self._download_zone_set, action), report)

    async def _download_zone_set(self, action: Action) -> ActionReport:
        digest = action.parameter(ZONE_SET_HASH)
        link = str(action.parameter(ZONE_SET_LINK))
        try:
            content = await download(link, None if digest is None else str(digest), self._settings)
            zone_set = self._read_zone_set(content)
        except (DownloadError, MalformedMessageError, ValueError) as error:
            raise WorkFailedError(str(error)) from error
        if zone_set.zone_set_id != action.parameter("zoneSetId"):
            raise WorkFailedError(f"{link} contains the zone set '{zone_set.zone_set_id}'")
        return ActionReport(action.action_id, ActionStatus.FINISHED, zone_set=zone_set)

    def _read_zone_set(self, content: bytes) -> ZoneSet:
        """Read ``content`` as a zone set message; a header is ignored.

        Raises:
            ValueError: ``content`` is not JSON.
            MalformedMessageError: ``content`` is not a zone set.
        """
        try:
            value: Any = json.loads(content)
        except RecursionError as error:
            raise ValueError("objects or arrays are nested too deeply") from error
        # Fleet controls offer the zoneSet object alone, or a whole message (VDA 5050 3.0, 6.2.3).
        inner = value.get(ENVELOPE, value) if isinstance(value, dict) else value
        header = {
            "headerId": 0,
            "timestamp": datetime.now(UTC).isoformat(),
            "version": self._codec.version,
            "manufacturer": "",
            "serialNumber": "",
        }
        payload = json.dumps(header | {ENVELOPE: inner}).encode()
        return self._codec.decode(ZoneSetTransfer, payload).zone_set


NO_ROS = 'it needs ROS, which this robot does not have; actions.without_ros = "rehearse" simulates it'


class UseBehaviorTree:
    """Selects the behaviour tree for an edge, which its goal names; the action ends with the edge."""

    def __init__(self, names: tuple[str, ...]) -> None:
        which = Parameter(BEHAVIOR_TREE, ValueDataType.STRING, choices=names)
        self.declaration = ActionDeclaration(
            USE_BEHAVIOR_TREE,
            scopes=(ActionScope.EDGE,),
            parameters=(which,),
            # The edge is driven meanwhile, which SOFT and HARD forbid (VDA 5050, 6.2.2; 2.1: 6.12).
            blocking_types=(BlockingType.NONE,),
            cancel_allowed=True,
            open_ended=True,
            restartable=True,
            description="Drives the edge with another behaviour tree of Nav2.",
        )

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Run until the edge ends."""
        return Countdown(action.action_id, LONGEST, report, lambda: None).start()


class Unavailable:
    """Declares an action that is unavailable, so that orders with it are refused with the reason."""

    def __init__(self, declaration: ActionDeclaration, reason: str = NO_ROS) -> None:
        self.declaration = replace(declaration, unavailable=reason)

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Fail; called only for an action that was accepted before the settings changed."""
        report(ActionReport(action.action_id, ActionStatus.FAILED, self.declaration.unavailable))
        return ENDED


class SimulatedOperation:
    """Simulates an action: takes ``seconds`` and has no other effect."""

    def __init__(self, declaration: ActionDeclaration, seconds: float, *, charging: bool | None) -> None:
        self.declaration = replace(
            declaration, pause_allowed=True, cancel_allowed=True, restartable=True, timeout=None
        )
        self._seconds = seconds
        self._charging = charging

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Start the countdown; an open-ended action runs until it is cancelled."""
        end = ActionReport(action.action_id, ActionStatus.FINISHED, "simulated", charging=self._charging)
        seconds = float("inf") if self.declaration.open_ended else self._seconds
        return Countdown(action.action_id, seconds, report, partial(report, end)).start()
