"""Briefs of 3.0: the names are the neutral ones; what only 3.0 has is checked as well."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from nena_shared.vda5050.brief.base import Brief, Percent, UInt32
from nena_shared.vda5050.brief.state import (
    ActionBrief,
    ControlPointBrief,
    EdgeBrief,
    ErrorBrief,
    PathBrief,
    PowerSupplyBrief,
    StateBrief,
    TrajectoryBrief,
    VisualizationBrief,
    ZoneRequestBrief,
)


class ControlPointBriefV30(ControlPointBrief, frozen=True, kw_only=True, gc=False):
    """A point that shapes a trajectory; one without weight would not."""

    weight: Annotated[float, Meta(gt=0)] | None = None


class TrajectoryBriefV30(TrajectoryBrief, frozen=True, kw_only=True, gc=False):
    """A NURBS."""

    control_points: tuple[ControlPointBriefV30, ...]


class EdgeBriefV30(EdgeBrief, frozen=True, kw_only=True, gc=False):
    """An edge that is still to be driven to its end."""

    trajectory: TrajectoryBriefV30 | None = None


class PlannedPathBriefV30(Brief, frozen=True, kw_only=True, gc=False):
    """The way that the robot means to drive at least to the end of its base."""

    trajectory: TrajectoryBriefV30
    traversed_nodes: tuple[str, ...] | None = None


class ZoneRequestBriefV30(ZoneRequestBrief, frozen=True, kw_only=True, gc=False):
    """A request about a zone."""

    trajectory: TrajectoryBriefV30 | None = None


class PowerSupplyBriefV30(PowerSupplyBrief, frozen=True, kw_only=True, gc=False):
    """The battery; A."""

    battery_current: float | None = None
    battery_health: Percent | None = None


class TranslationBriefV30(Brief, frozen=True, kw_only=True, gc=False):
    """The same text in another language."""

    translation_key: str
    translation_value: str


class ErrorBriefV30(ErrorBrief, frozen=True, kw_only=True, gc=False):
    """One active error; the codec reads the older name of a type."""

    error_type: Annotated[str, Meta(pattern="^(?!INVALID_ORDER$)")]
    error_description_translations: tuple[TranslationBriefV30, ...] | None = None
    error_hint_translations: tuple[TranslationBriefV30, ...] | None = None


class StateBriefV30(StateBrief, frozen=True, kw_only=True, gc=False):
    """What watchers need of a state."""

    edge_states: tuple[EdgeBriefV30, ...]
    planned_path: PlannedPathBriefV30 | None = None
    zone_requests: tuple[ZoneRequestBriefV30, ...] | None = None
    zone_action_states: tuple[ActionBrief, ...] | None = None
    power_supply: PowerSupplyBriefV30
    errors: tuple[ErrorBriefV30, ...]


class VisualizationBriefV30(VisualizationBrief, frozen=True, kw_only=True, gc=False):
    """What watchers need of a visualization."""

    reference_state_header_id: UInt32
    planned_path: PlannedPathBriefV30 | None = None
    intermediate_path: PathBrief | None = None


FORMS: dict[type[Brief], type[Brief]] = {StateBrief: StateBriefV30, VisualizationBrief: VisualizationBriefV30}
