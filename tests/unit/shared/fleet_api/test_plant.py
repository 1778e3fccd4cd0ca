from __future__ import annotations

from base64 import b64encode
from typing import Any

import pytest
from pydantic import ValidationError

from nena_shared.fleet_api import plant
from nena_shared.fleet_api.plant import (
    PAYLOAD_LIMIT,
    PNG_LIMIT,
    MapImage,
    png_size,
)
from support import robot_maps


def test_map_image_round_trip() -> None:
    sent = robot_maps.robot_map(theta=0.5)
    payload = sent.model_dump_json(by_alias=True)
    assert MapImage.model_validate_json(payload) == sent
    assert sent.size == (40, 20)
    assert '"mapId":"hall"' in payload


@pytest.mark.parametrize(
    "wrong",
    [
        {"png": b64encode(b"GIF89a" + bytes(40))},
        {"png": b64encode(b"\x89PNG")},
        {"digest": "../../etc"},
        {"resolution": 0.0},
        {"x": float("nan")},
    ],
)
def test_invalid_map_is_refused(wrong: dict[str, Any]) -> None:
    content = {**robot_maps.robot_map().model_dump(), **wrong}
    with pytest.raises(ValidationError, match=next(iter(wrong))):
        MapImage.model_validate(content)


@pytest.mark.parametrize("limit", ["SIDE_LIMIT", "PNG_LIMIT"])
def test_an_image_that_is_too_large_is_refused(limit: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plant, limit, 30)
    with pytest.raises(ValidationError, match="must be a PNG image of at most"):
        robot_maps.robot_map()


def test_the_largest_image_fits_into_a_message() -> None:
    assert len(b64encode(bytes(PNG_LIMIT))) + 10_000 < PAYLOAD_LIMIT


def test_non_image_has_no_size() -> None:
    assert png_size(b"") is None
