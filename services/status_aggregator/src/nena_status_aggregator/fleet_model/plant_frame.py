"""Puts what robots say of places into the plant's frame, as the order service does.

A robot that transforms itself speaks in that frame already; so does any on a map for which the plant model
has no transform.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from msgspec.structs import replace

from nena_shared.log import get_logger
from nena_shared.plant import MapPlace, MapPose, MapTransform, PlantModel
from nena_shared.plant.map_transforms import map_transforms
from nena_shared.vda5050.brief.state import PositionBrief
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.own_actions import transforms_itself

log = get_logger(__name__)


@dataclass(frozen=True, slots=True)
class PlantFrame:
    """How the plant lies on maps, by their ids."""

    transforms: Mapping[str, MapTransform] = field(default_factory=dict)

    @classmethod
    def of(cls, plant: PlantModel | None) -> PlantFrame:
        """Take what a plant model says; one that says nonsense says nothing."""
        try:
            return cls(map_transforms(plant)) if plant else cls()
        except ValueError as error:
            log.warning("the plant model's transforms are passed over", reason=str(error))
            return cls()

    def position(self, at: PositionBrief | None, sheet: Factsheet | None) -> PositionBrief | None:
        """Give a position; None too before a factsheet has said who transforms."""
        transform = self.transforms.get(at.map_id) if at else None
        if at is None or transform is None or (sheet and transforms_itself(sheet)):
            return at
        if sheet is None:
            return None
        pose = transform.pose_to_plant(MapPose(at.x, at.y, at.theta))
        return replace(at, x=pose.x_m, y=pose.y_m, theta=pose.heading_rad)

    def place(
        self, x: float, y: float, map_id: str | None, sheet: Factsheet | None
    ) -> tuple[float, float] | None:
        """Give a place, m; None as for :meth:`position`."""
        transform = self.transforms.get(map_id) if map_id else None
        if transform is None or (sheet and transforms_itself(sheet)):
            return x, y
        if sheet is None:
            return None
        place = transform.to_plant(MapPlace(x, y))
        return place.x_m, place.y_m
