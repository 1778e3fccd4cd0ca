"""The drawn course of a path, from the layout's pixels into the plant frame where that is possible."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from nena_shared.plant.opentcs_xml.drawing import Drawn
from nena_shared.plant.opentcs_xml.xml_object import XmlObject
from nena_shared.plant.path import ConnectionType, ControlPoint, PathLayout
from nena_shared.plant.visual_layout import VisualLayout

FRAME_TOLERANCE_MM: Final = 1
"""As far apart may an object's place in the model and in the layout be, and still count as the same."""

_CONTROL_POINTS: Final[Mapping[ConnectionType, int]] = MappingProxyType(
    {
        ConnectionType.BEZIER: 2,
        ConnectionType.BEZIER_3: 5,
    }
)


def same_place(model_mm: tuple[int, int], drawn_mm: tuple[int, int]) -> bool:
    """Whether a position in the model and one in the layout are the same place."""
    return all(
        abs(model - drawn) <= FRAME_TOLERANCE_MM for model, drawn in zip(model_mm, drawn_mm, strict=True)
    )


def course(path: XmlObject, drawn: Drawn, layout: VisualLayout, *, same_frame: bool) -> PathLayout:
    """Return the path's layout with control points in mm of the plant frame.

    Control points belong to the layout's frame. If the path's ends lie elsewhere there than in the model
    (`same_frame` is false), or their number does not fit the curve, they are dropped with a warning.
    """
    reason = _reason_to_drop(drawn, same_frame=same_frame)
    if reason:
        path.warn("CONTROL_POINTS_DROPPED", f"{reason}; the path is drawn as a straight line")
        return PathLayout(layer_id=drawn.label.layer_id)
    return PathLayout(
        connection_type=drawn.connection_type,
        control_points=tuple(
            # The layout's y grows downwards.
            ControlPoint(x_mm=x * layout.scale_x_mm_per_px, y_mm=-y * layout.scale_y_mm_per_px)
            for x, y in drawn.control_points_px
        ),
        layer_id=drawn.label.layer_id,
    )


def _reason_to_drop(drawn: Drawn, *, same_frame: bool) -> str:
    found = len(drawn.control_points_px)
    wanted = _CONTROL_POINTS.get(drawn.connection_type, found)
    if found != wanted:
        return f"{drawn.connection_type} needs {wanted} control points and has {found}"
    if found and not same_frame:
        return (
            "its end points lie elsewhere in the drawing than in the model, so its control points do not fit"
        )
    return ""
