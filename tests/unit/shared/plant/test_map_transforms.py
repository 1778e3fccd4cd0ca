from __future__ import annotations

from math import pi

import pytest

from nena_shared.plant.checks import find_errors, find_warnings
from nena_shared.plant.map_transforms import map_transforms, parse_transform
from nena_shared.plant.transform import MapTransform
from support.plants import plant


def test_each_map_has_its_own() -> None:
    properties = {
        "nena:mapTransform.hall": "scale=0.1 rotation=90 x=5 y=-1",
        "nena:mapTransform.yard": "x=-2.5",
        "key": "x=1",
    }
    model = plant(points="A", properties=properties)
    assert map_transforms(model) == {
        "hall": MapTransform(scale=0.1, rotation_rad=pi / 2, offset_x_m=5, offset_y_m=-1),
        "yard": MapTransform(offset_x_m=-2.5),
    }
    assert find_errors(model) == ()
    assert "MISSPELT_PROPERTY" not in {problem.code for problem in find_warnings(model)}


@pytest.mark.parametrize(
    "text", ["", "90", "scale=0", "scale=-1", "x=", "x=inf", "x=1 z=2", "x=1 x=2", "x = 1"]
)
def test_what_is_no_transform_makes_the_model_unusable(text: str) -> None:
    with pytest.raises(ValueError, match=r"transform|form|float"):
        parse_transform(text)
    model = plant(points="A", properties={"nena:mapTransform.hall": text})
    (error,) = find_errors(model)
    assert error.code == "BAD_VALUE"
    assert "'hall'" in error.text
