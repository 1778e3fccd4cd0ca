"""Maps as map_server reads them: modes, negate, alpha, origins, and files that are no maps."""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from nena_plant_formats.from_map.robot_map import RobotMapError, read_map
from support.drawn_maps import FREE, OCCUPIED, UNKNOWN, hall, write_map

SHADES = np.array([[FREE, UNKNOWN, 128, OCCUPIED]], dtype=np.uint8)


@pytest.mark.parametrize(
    ("values", "free"),
    [
        ({}, [True, False, False, False]),
        ({"free_thresh": 0.196}, [True, False, False, False]),
        ({"free_thresh": 0.6}, [True, False, True, False]),
        ({"negate": 1}, [False, False, False, True]),
        ({"negate": "true", "mode": "scale"}, [False, False, False, True]),
        ({"mode": "scale"}, [True, True, False, False]),
        ({"mode": "raw"}, [False, False, False, True]),
    ],
)
def test_which_cells_are_free(tmp_path: Path, values: dict[str, Any], free: list[bool]) -> None:
    assert read_map(write_map(tmp_path, SHADES, **values)).free.tolist() == [free]


@pytest.mark.parametrize(
    ("mode", "free"), [("trinary", [True, True, False]), ("scale", [True, False, False])]
)
def test_alpha(tmp_path: Path, mode: str, free: list[bool]) -> None:
    image = np.array([[[255] * 4, [255, 255, 255, 100], [0, 0, 0, 255]]], dtype=np.uint8)
    Image.fromarray(image).save(tmp_path / "site.png")
    path = write_map(tmp_path, SHADES, mode=mode, image="site.png")
    assert read_map(path).free.tolist() == [free]


def test_rows_and_a_turned_origin(tmp_path: Path) -> None:
    image = np.array([[OCCUPIED, OCCUPIED], [OCCUPIED, FREE]], dtype=np.uint8)
    read = read_map(write_map(tmp_path, image, origin=f"[10.0, -2.0, {pi / 2}]", resolution=0.5))
    assert read.free.tolist() == [[False, True], [False, False]]
    # The second cell of the bottom row is 0.75 m along the map's first axis, which points up.
    assert read.to_plane(np.array([[1.0, 0.0]]))[0] == pytest.approx((9.75, -1.25))


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({"mode": "grey"}, "mode 'grey' is unknown. Use trinary, scale, raw"),
        ({"resolution": 0}, "resolution 0.0 must be greater than 0"),
        ({"resolution": "fine"}, "resolution 'fine' must be a number"),
        ({"origin": "[0.0, 0.0]"}, "origin [0.0, 0.0] must be [x, y, yaw]"),
        ({"origin": "[0.0, 0.0, .nan]"}, "origin nan must be a number"),
        ({"free_thresh": "low"}, "free_thresh 'low' must be a number"),
        ({"image": "[a, b]"}, "names no image"),
        ({"image": "site.yaml"}, "site.yaml is no PGM, PNG or BMP"),
    ],
)
def test_what_is_no_map(tmp_path: Path, values: dict[str, Any], problem: str) -> None:
    with pytest.raises(RobotMapError) as caught:
        read_map(write_map(tmp_path, hall(1, 1), **values))
    assert problem in str(caught.value)


@pytest.mark.parametrize("text", ["- a\n", "a: [", "", "\x00"])
def test_file_without_values(tmp_path: Path, text: str) -> None:
    (tmp_path / "site.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(RobotMapError, match=r"site\.yaml (is no YAML|names no image)"):
        read_map(tmp_path / "site.yaml")
