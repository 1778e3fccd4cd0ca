"""The visualization message (VDA 5050 3.0 sections 6.7 and 7.9)."""

from __future__ import annotations

from nena_shared.vda5050.base import Header, UInt32
from nena_shared.vda5050.state import IntermediatePath, MobileRobotPosition, PlannedPath, Velocity


class Visualization(Header):
    """Position and path at a higher rate than the state, for displays only (section 6.7)."""

    reference_state_header_id: UInt32
    mobile_robot_position: MobileRobotPosition | None = None
    velocity: Velocity | None = None
    planned_path: PlannedPath | None = None
    intermediate_path: IntermediatePath | None = None
