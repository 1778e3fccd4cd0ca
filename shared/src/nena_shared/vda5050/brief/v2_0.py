"""Briefs of 2.0: those of 2.1 without maps and hints, which the codec passes over where they are sent."""

from __future__ import annotations

from nena_shared.vda5050.brief.base import Brief
from nena_shared.vda5050.brief.state import StateBrief, VisualizationBrief
from nena_shared.vda5050.brief.v2_1 import ErrorBriefV21, StateBriefV21, VisualizationBriefV21


class ErrorBriefV20(ErrorBriefV21, frozen=True, kw_only=True, gc=False):
    """One active error."""

    error_hint: None = None


class StateBriefV20(StateBriefV21, frozen=True, kw_only=True, gc=False):
    """What watchers need of a state."""

    maps: None = None
    errors: tuple[ErrorBriefV20, ...]


FORMS: dict[type[Brief], type[Brief]] = {StateBrief: StateBriefV20, VisualizationBrief: VisualizationBriefV21}
