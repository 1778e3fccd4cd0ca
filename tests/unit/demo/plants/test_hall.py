from __future__ import annotations

from collections import defaultdict

import pytest

from nena_demo.plants.hall import BLOCKED_AISLE, GATE, Hall, make_hall
from nena_plant_formats.files import read
from nena_shared.plant import PlantModel


def hall(robots: int) -> Hall:
    return make_hall(tuple(f"AMR-{number}" for number in range(robots)))


def reachable(plant: PlantModel, start: str, *, without: str) -> set[str]:
    ways = defaultdict(list)
    for path in plant.paths:
        if path.name != without:
            ways[path.source].append(path.destination)
    found, waiting = {start}, [start]
    while waiting:
        new = set(ways[waiting.pop()]) - found
        found |= new
        waiting += new
    return found


@pytest.mark.parametrize("robots", [1, 12, 52, 200])
def test_every_station_is_reachable_from_every_other_also_when_the_aisle_is_blocked(robots: int) -> None:
    plant = hall(robots).plant
    stations = {link.point for each in plant.locations for link in each.links}

    assert BLOCKED_AISLE in plant.paths_by_name
    for station in stations:
        assert stations <= reachable(plant, station, without=BLOCKED_AISLE)


def test_the_door_opens_before_its_path_and_closes_behind_the_next() -> None:
    operations = {
        path.name: [each.name for each in path.peripheral_operations]
        for path in hall(12).plant.paths
        if path.peripheral_operations
    }

    assert operations == {"Middle 5 --- Middle 6": ["open"], "Middle 6 --- Middle 7": ["close"]}
    assert GATE in hall(12).plant.locations_by_name


def test_the_order_service_reads_it_unchanged() -> None:
    report = read(hall(12).plant.to_json().encode())

    assert report.model == hall(12).plant
    assert report.warnings == (), "a door needs no link"
