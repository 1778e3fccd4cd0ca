"""The visualization message of 3.0 (section 7.9)."""

from __future__ import annotations

from nena_shared.vda5050.v3_0.state import PlannedPathV30
from nena_shared.vda5050.visualization import Visualization


class VisualizationV30(Visualization):
    """Position and way at a higher rate than the state."""

    planned_path: PlannedPathV30 | None = None
