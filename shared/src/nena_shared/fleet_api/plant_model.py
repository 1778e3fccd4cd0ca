"""What an order service says of a plant model that it was sent."""

from __future__ import annotations

from nena_shared.fleet_api.base import Resource


class PlantModelChange(Resource):
    """What has become of a plant model that was sent."""

    name: str
    changed: bool
    """Whether it is in use now; false: it was only checked."""
    points: int
    paths: int
    locations: int
    blocks: int
    vehicles: int
    warnings: tuple[str, ...] = ()
