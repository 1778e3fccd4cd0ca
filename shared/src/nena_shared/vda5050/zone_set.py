"""The zoneSet message (VDA 5050 3.0 sections 6.4 and 7.6); 2.x has no zones."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from types import MappingProxyType
from typing import Annotated, Any, Final, Self

from pydantic import ConfigDict, Field, model_validator

from nena_shared.vda5050.action import ActionParameter, BlockingType
from nena_shared.vda5050.base import Angle, Header, Identifier, NotNegative, WireObject

Factor = Annotated[float, Field(ge=0, le=1)]


class ZoneType(StrEnum):
    """Type of a zone, which defines how robots behave in it (section 6.4)."""

    BLOCKED = "BLOCKED"
    LINE_GUIDED = "LINE_GUIDED"
    RELEASE = "RELEASE"
    COORDINATED_REPLANNING = "COORDINATED_REPLANNING"
    SPEED_LIMIT = "SPEED_LIMIT"
    ACTION = "ACTION"
    PRIORITY = "PRIORITY"
    PENALTY = "PENALTY"
    DIRECTED = "DIRECTED"
    BIDIRECTED = "BIDIRECTED"


class ZoneReleaseLossBehavior(StrEnum):
    """What a robot inside a RELEASE zone does when its release is revoked (section 6.4.3)."""

    STOP = "STOP"
    CONTINUE = "CONTINUE"
    EVACUATE = "EVACUATE"


class DirectedLimitation(StrEnum):
    """How strictly a robot follows the direction of a DIRECTED zone (section 7.6)."""

    SOFT = "SOFT"
    RESTRICTED = "RESTRICTED"
    STRICT = "STRICT"


class BidirectedLimitation(StrEnum):
    """How strictly a robot follows the two directions of a BIDIRECTED zone (section 7.6)."""

    SOFT = "SOFT"
    RESTRICTED = "RESTRICTED"


class Vertex(WireObject):
    """A corner of a zone, m in the project-wide frame of the map (section 7.6)."""

    x: float
    y: float


class ZoneAction(WireObject):
    """An action triggered by a zone; the robot assigns an ID each time (section 6.4)."""

    action_type: Identifier
    action_descriptor: str | None = None
    blocking_type: BlockingType
    action_parameters: tuple[ActionParameter, ...] = ()
    retriable: bool | None = None


REQUIRED: Final[Mapping[ZoneType, tuple[str, ...]]] = MappingProxyType(
    {
        ZoneType.SPEED_LIMIT: ("maximum_speed",),
        ZoneType.ACTION: ("entry_actions", "during_actions", "exit_actions"),
        ZoneType.PRIORITY: ("priority_factor",),
        ZoneType.PENALTY: ("penalty_factor",),
        ZoneType.DIRECTED: ("direction", "directed_limitation"),
        ZoneType.BIDIRECTED: ("direction", "bidirected_limitation"),
    }
)
"""Fields of each zone type in addition to the common ones."""


def _by_type(schema: dict[str, Any], kind: type[WireObject]) -> None:
    """Add the required fields of each zone type to the JSON Schema of ``kind``."""
    # the schema of 3.0.0 does not say this; 7.6 does in words
    schema["allOf"] = [
        {
            "if": {"properties": {"zoneType": {"const": zone_type.value}}, "required": ["zoneType"]},
            "then": {"required": [kind.model_fields[name].alias for name in names]},
        }
        for zone_type, names in REQUIRED.items()
    ]


class Zone(WireObject):
    """An area of a map: a simple polygon, counter-clockwise; m/s and rad (section 7.6)."""

    model_config = ConfigDict(json_schema_extra=_by_type)

    zone_id: Identifier
    zone_type: ZoneType
    zone_descriptor: str | None = None
    vertices: Annotated[tuple[Vertex, ...], Field(min_length=3)]
    release_loss_behavior: ZoneReleaseLossBehavior | None = None
    """For RELEASE zones; None means STOP."""
    maximum_speed: NotNegative | None = None
    entry_actions: tuple[ZoneAction, ...] | None = None
    during_actions: tuple[ZoneAction, ...] | None = None
    exit_actions: tuple[ZoneAction, ...] | None = None
    priority_factor: Factor | None = None
    penalty_factor: Factor | None = None
    """1: only without an alternative route."""
    direction: Angle | None = None
    directed_limitation: DirectedLimitation | None = None
    bidirected_limitation: BidirectedLimitation | None = None

    @model_validator(mode="after")
    def _has_what_its_type_needs(self) -> Self:
        # None, not false: an ACTION zone may have empty lists, and a factor 0
        if missing := [name for name in REQUIRED.get(self.zone_type, ()) if getattr(self, name) is None]:
            names = ", ".join(str(type(self).model_fields[name].alias) for name in missing)
            raise ValueError(f"a {self.zone_type} zone needs {names}")
        return self


class ZoneSet(WireObject):
    """Zones of one map; the content of a zoneSetId never changes (section 6.4.1)."""

    map_id: Identifier
    zone_set_id: Identifier
    zone_set_descriptor: str | None = None
    zones: tuple[Zone, ...]

    @model_validator(mode="after")
    def _names_each_zone_once(self) -> Self:
        seen: set[str] = set()
        for zone in self.zones:
            if zone.zone_id in seen:
                raise ValueError(f"zoneId {zone.zone_id!r} occurs twice in the zone set")
            seen.add(zone.zone_id)
        return self


class ZoneSetTransfer(Header):
    """Transfers a zone set to a robot; it is DISABLED until enabled by an action (section 6.4.1)."""

    zone_set: ZoneSet
