"""The visualization message of 2.1 (section 6.13)."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from nena_shared.vda5050.base import Identifier, UInt32, Version
from nena_shared.vda5050.v2_1.base import TimestampOrNow
from nena_shared.vda5050.v2_1.state import MobileRobotPositionV21
from nena_shared.vda5050.visualization import Visualization
from nena_shared.vda5050.wire_names import Absent, always


class VisualizationV21(Visualization):
    """Position and speed; it does not say which state it belongs to, and not always who sends it."""

    header_id: UInt32 = 0
    timestamp: TimestampOrNow
    version: Version = "2.0.0"
    manufacturer: Identifier = ""
    serial_number: Identifier = ""
    reference_state_header_id: Annotated[UInt32, always(0), Field(exclude=True)] = 0
    mobile_robot_position: Annotated[MobileRobotPositionV21 | None, Field(alias="agvPosition")] = None
    planned_path: Absent = None
    intermediate_path: Absent = None
