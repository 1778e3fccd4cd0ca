"""Where the plant lies on each map, as the model's properties `nena:mapTransform.<map id>` say."""

import re
from collections.abc import Iterator, Mapping
from math import radians
from typing import Final

from nena_shared.plant import property_keys as keys
from nena_shared.plant.errors import ObjectKind, Problem
from nena_shared.plant.model import PlantModel
from nena_shared.plant.transform import MapTransform

_PAIR: Final = re.compile(r"(scale|rotation|x|y)=(\S+)")
_WANTED: Final = "'scale=1 rotation=0 x=0 y=0' (rotation in degrees, x and y in metres of the map)"


def map_transforms(model: PlantModel) -> Mapping[str, MapTransform]:
    """Return the transform to each map for which the model has one; on others plant and map are the same.

    Raises ValueError for a property that is no transform; importers refuse such a model.
    """
    return {map_id: parse_transform(text) for map_id, text in _written(model)}


def transform_errors(model: PlantModel) -> Iterator[Problem]:
    """Yield each property that is no transform: robots would drive elsewhere."""
    for map_id, text in _written(model):
        try:
            parse_transform(text)
        except ValueError as error:
            problem = f"the transform to map {map_id!r} cannot be used: {error}"
            yield Problem("BAD_VALUE", ObjectKind.MODEL, model.name, problem)


def parse_transform(text: str) -> MapTransform:
    """Return what a text such as `scale=0.1 rotation=90 x=5 y=-1` says; what it leaves out changes nothing.

    Rotation in degrees counter-clockwise, x and y in metres of the map. Raises ValueError.
    """
    pairs = [_PAIR.fullmatch(part) for part in text.split()]
    found = {pair[1]: pair[2] for pair in pairs if pair}
    if not found or len(found) < len(pairs):
        msg = f"{text!r} is not of the form {_WANTED}"
        raise ValueError(msg)
    numbers = {key: float(value) for key, value in found.items()}
    return MapTransform(
        scale=numbers.get("scale", 1.0),
        rotation_rad=radians(numbers.get("rotation", 0.0)),
        offset_x_m=numbers.get("x", 0.0),
        offset_y_m=numbers.get("y", 0.0),
    )


def _written(model: PlantModel) -> Iterator[tuple[str, str]]:
    for key, text in model.properties.items():
        if key.startswith(keys.MAP_TRANSFORM):
            yield key.removeprefix(keys.MAP_TRANSFORM), text
