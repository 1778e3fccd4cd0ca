"""Messages of a small fleet, as the aggregator reads them."""

from __future__ import annotations

from typing import Any

from msgspec import convert

from nena_shared.vda5050.brief.state import PositionBrief, StateBrief, VisualizationBrief
from support import fleet_examples


def state(number: int = 1, **content: Any) -> StateBrief:
    """Make the brief of a state, see :func:`fleet_examples.state`."""
    return convert(fleet_examples.state(number, **content), StateBrief, from_attributes=True)


def visualization(number: int = 1, **content: Any) -> VisualizationBrief:
    """Make the brief of a visualization, see :func:`fleet_examples.visualization`."""
    full = fleet_examples.visualization(number, **content)
    return convert(full, VisualizationBrief, from_attributes=True)


def place(x: float, y: float, *, map_id: str = "hall", localized: bool = True) -> PositionBrief:
    """Make a position, m."""
    return PositionBrief(x=x, y=y, theta=0.0, map_id=map_id, localized=localized)
