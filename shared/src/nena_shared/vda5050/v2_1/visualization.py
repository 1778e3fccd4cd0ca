"""The visualization message of 2.1 (section 6.13)."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from nena_shared.vda5050.base import UInt32
from nena_shared.vda5050.v2_1.base import Absent, TimestampV2, always
from nena_shared.vda5050.v2_1.state import MobileRobotPositionV21
from nena_shared.vda5050.visualization import Visualization


class VisualizationV21(Visualization):
    """Position and speed; it does not say which state it belongs to."""

    timestamp: TimestampV2
    reference_state_header_id: Annotated[UInt32, always(0), Field(exclude=True)] = 0
    mobile_robot_position: Annotated[MobileRobotPositionV21 | None, Field(alias="agvPosition")] = None
    planned_path: Absent = None
    intermediate_path: Absent = None
