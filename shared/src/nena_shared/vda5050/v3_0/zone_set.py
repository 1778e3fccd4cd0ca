"""The zoneSet message of 3.0 (section 7.6), whose schema misspells some names."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import AliasChoices, BeforeValidator, Field, ValidationInfo, model_validator

from nena_shared.vda5050.v3_0.action import ActionTypeV30
from nena_shared.vda5050.zone_set import (
    BidirectedLimitation,
    DirectedLimitation,
    Factor,
    Zone,
    ZoneAction,
    ZoneReleaseLossBehavior,
    ZoneSet,
    ZoneSetTransfer,
    ZoneType,
)


def _of_zone_type(zone_type: ZoneType) -> BeforeValidator:
    """Take a value only in a zone of that type, since ``limitation`` may mean either of two fields."""

    def read(value: object, info: ValidationInfo) -> object:
        return value if info.data.get("zone_type") is zone_type else None

    return BeforeValidator(read)


class ZoneActionV30(ZoneAction):
    """An action that a zone triggers."""

    action_type: ActionTypeV30


class ZoneV30(Zone):
    """An area of a map; a RELEASE zone always says what a lost release means."""

    entry_actions: tuple[ZoneActionV30, ...] | None = None
    during_actions: tuple[ZoneActionV30, ...] | None = None
    exit_actions: tuple[ZoneActionV30, ...] | None = None
    priority_factor: Annotated[
        Factor | None, Field(validation_alias=AliasChoices("priorityFactor", "priorityFactor "))
    ] = None
    penalty_factor: Annotated[
        Factor | None, Field(validation_alias=AliasChoices("penaltyFactor", "penaltyFactor "))
    ] = None

    directed_limitation: Annotated[
        DirectedLimitation | None,
        _of_zone_type(ZoneType.DIRECTED),
        Field(validation_alias=AliasChoices("directedLimitation", "limitation")),
    ] = None
    bidirected_limitation: Annotated[
        BidirectedLimitation | None,
        _of_zone_type(ZoneType.BIDIRECTED),
        Field(validation_alias=AliasChoices("bidirectedLimitation", "limitation")),
    ] = None

    @model_validator(mode="after")
    def _stops_without_release(self) -> Self:
        if self.zone_type is not ZoneType.RELEASE or self.release_loss_behavior:
            return self
        return self.model_copy(update={"release_loss_behavior": ZoneReleaseLossBehavior.STOP})


class ZoneSetV30(ZoneSet):
    """Zones of one map."""

    zones: tuple[ZoneV30, ...]


class ZoneSetTransferV30(ZoneSetTransfer):
    """Brings a zone set to a robot."""

    zone_set: ZoneSetV30
