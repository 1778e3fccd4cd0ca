from __future__ import annotations

import gc

import pytest

from nena_status_aggregator.fleet_model import map_shelf
from nena_status_aggregator.fleet_model.map_shelf import MapShelf
from support.robot_maps import robot_map

OTHER = "fedcba9876543210"


def test_equal_maps_are_kept_once() -> None:
    shelf = MapShelf()
    first = shelf.shared(robot_map())
    assert shelf.shared(robot_map()) is first
    assert shelf.shared(robot_map(OTHER)) is not first
    elsewhere = robot_map(x=5.0)
    assert shelf.shared(elsewhere) is elsewhere, "the same digest does not make it the same map"


def test_a_map_without_room_is_not_taken_until_another_one_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_shelf, "ROOM", 2 * len(robot_map().png) - 1)
    shelf = MapShelf()
    first = shelf.shared(robot_map())
    assert first is not None
    assert shelf.shared(robot_map(OTHER)) is None
    del first
    gc.collect()
    assert shelf.shared(robot_map(OTHER)) is not None
