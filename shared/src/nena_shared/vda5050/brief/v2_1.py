"""Briefs of 2.1; values that it spells otherwise than 3.0 fit none of these fields: the codec reads them."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, field
from msgspec.structs import force_setattr

from nena_shared.vda5050.brief.base import Brief, Identifier, NotNegative, Percent, Share
from nena_shared.vda5050.brief.state import (
    ActionBrief,
    EdgeBrief,
    ErrorBrief,
    InformationBrief,
    MapBrief,
    NodeBrief,
    PositionBrief,
    PowerSupplyBrief,
    ReferenceBrief,
    SafetyBrief,
    StateBrief,
    TrajectoryBrief,
    VisualizationBrief,
)
from nena_shared.vda5050.state import EmergencyStop
from nena_shared.vda5050.v2_1.error import PARAMETER
from nena_shared.vda5050.v2_1.parameter import neutral_path


class MapBriefV21(MapBrief, frozen=True, kw_only=True, gc=False):
    """A map that the robot holds."""

    map_descriptor: str | None = field(default=None, name="mapDescription")


class NodeBriefV21(NodeBrief, frozen=True, kw_only=True, gc=False):
    """A node that is still to be traversed."""

    node_descriptor: str | None = field(default=None, name="nodeDescription")


class TrajectoryBriefV21(TrajectoryBrief, frozen=True, kw_only=True, gc=False):
    """A NURBS; what is left out is filled in by the codec."""

    degree: Annotated[int, Meta(ge=1)]
    knot_vector: tuple[Share, ...]


class EdgeBriefV21(EdgeBrief, frozen=True, kw_only=True, gc=False):
    """An edge that is still to be driven to its end."""

    edge_descriptor: str | None = field(default=None, name="edgeDescription")
    trajectory: TrajectoryBriefV21 | None = None


class PositionBriefV21(PositionBrief, frozen=True, kw_only=True, gc=False):
    """Where the robot is."""

    localized: bool = field(name="positionInitialized")


class ActionBriefV21(ActionBrief, frozen=True, kw_only=True, gc=False):
    """Where one action stands."""

    action_descriptor: str | None = field(default=None, name="actionDescription")
    action_result: str | None = field(default=None, name="resultDescription")


class PowerSupplyBriefV21(PowerSupplyBrief, frozen=True, kw_only=True, gc=False):
    """The battery."""

    state_of_charge: Percent = field(name="batteryCharge")
    range: NotNegative | None = field(default=None, name="reach")


class SafetyBriefV21(SafetyBrief, frozen=True, kw_only=True, gc=False):
    """Emergency stop and protective field."""

    active_emergency_stop: EmergencyStop = field(name="eStop")


class ReferenceBriefV21(ReferenceBrief, frozen=True, kw_only=True, gc=False):
    """What an error is about; parameters of the order have their 2.x names, as key or as value."""

    def __post_init__(self) -> None:
        """Take the neutral names."""
        key = neutral_path(self.reference_key)
        force_setattr(self, "reference_key", key)
        if key == PARAMETER:
            force_setattr(self, "reference_value", neutral_path(self.reference_value))


class ErrorBriefV21(ErrorBrief, frozen=True, kw_only=True, gc=False):
    """One active error."""

    error_references: tuple[ReferenceBriefV21, ...] = ()


class InformationBriefV21(InformationBrief, frozen=True, kw_only=True, gc=False):
    """A remark for people."""

    info_descriptor: str | None = field(default=None, name="infoDescription")


class StateBriefV21(StateBrief, frozen=True, kw_only=True, gc=False):
    """What watchers need of a state."""

    maps: tuple[MapBriefV21, ...] | None = None
    zone_set_id: Identifier | None = None
    node_states: tuple[NodeBriefV21, ...]
    edge_states: tuple[EdgeBriefV21, ...]
    intermediate_path: None = None
    zone_sets: None = None
    zone_requests: None = None
    edge_requests: None = None
    mobile_robot_position: PositionBriefV21 | None = field(default=None, name="agvPosition")
    action_states: tuple[ActionBriefV21, ...]
    instant_action_states: tuple[()] = ()
    power_supply: PowerSupplyBriefV21 = field(name="batteryState")
    errors: tuple[ErrorBriefV21, ...]
    information: tuple[InformationBriefV21, ...] | None = None
    safety_state: SafetyBriefV21


class VisualizationBriefV21(VisualizationBrief, frozen=True, kw_only=True, gc=False):
    """What watchers need of a visualization; one without a header is read by the codec."""

    mobile_robot_position: PositionBriefV21 | None = field(default=None, name="agvPosition")


FORMS: dict[type[Brief], type[Brief]] = {StateBrief: StateBriefV21, VisualizationBrief: VisualizationBriefV21}
