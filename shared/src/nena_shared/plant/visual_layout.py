"""What a drawn plant needs besides the objects themselves: scale, layers and groups of layers."""

from collections.abc import Mapping

from pydantic import Field

from nena_shared.plant.record import PlantRecord


class Layer(PlantRecord):
    """A layer of the drawing; a higher ordinal lies above a lower one."""

    id: int
    ordinal: int
    name: str
    visible: bool = True
    group_id: int = 0


class LayerGroup(PlantRecord):
    """A group of layers that are shown or hidden together."""

    id: int
    name: str
    visible: bool = True


class VisualLayout(PlantRecord):
    """The drawing of a plant; the scales are mm per pixel of the plant's own editor."""

    name: str = "VLayout"
    scale_x_mm_per_px: float = Field(default=50.0, gt=0)
    scale_y_mm_per_px: float = Field(default=50.0, gt=0)
    layers: tuple[Layer, ...] = ()
    layer_groups: tuple[LayerGroup, ...] = ()
    properties: Mapping[str, str] = Field(default_factory=dict)
