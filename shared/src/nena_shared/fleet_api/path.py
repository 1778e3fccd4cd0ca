"""Paths of the plant as hosts may change them."""

from __future__ import annotations

from nena_shared.fleet_api.base import Resource


class PathStatus(Resource):
    """One path as it stands."""

    name: str
    source_point: str
    destination_point: str
    locked: bool
    """Whether new routes keep off it."""
    locked_in_plant_model: bool
    """What holds where no host has said otherwise."""
