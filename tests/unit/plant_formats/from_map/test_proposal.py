"""Proposed plants: robots reach all free places, keep their distance, and can pass each other."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot
from pathlib import Path

import numpy as np
import pytest
import rustworkx as rx
from scipy import ndimage
from scipy.spatial import cKDTree

from nena_plant_formats.from_map.free_space import FreeSpace, RobotSize
from nena_plant_formats.from_map.proposal import COVER, Proposal, propose_plant
from nena_plant_formats.from_map.robot_map import RobotMap, RobotMapError, read_map
from nena_shared.plant import Path as PlantPath
from nena_shared.plant import PlantModel
from nena_shared.plant.fleet_checks import find_fleet_errors
from support.drawn_maps import CELL, Pixels, block, hall, office, warehouse, write_map

SIZE = RobotSize(width=0.6, length=0.8, clearance=0.1)


def l_shaped() -> Pixels:
    image = hall(12, 12)
    block(image, 3, 1, 10, 10)
    return image


def cluttered(seed: int) -> Callable[[], Pixels]:
    def draw() -> Pixels:
        image, random = hall(22, 16), np.random.default_rng(seed)
        for x, y, side in zip(
            random.uniform(1, 22, 60), random.uniform(1, 16, 60), random.uniform(0.1, 1.5, 60), strict=True
        ):
            block(image, x, y, side, side)
        return image

    return draw


MAPS: dict[str, Callable[[], Pixels]] = {
    "open hall": lambda: hall(20, 14),
    "corridor": lambda: hall(30, 1.2),
    "one place": lambda: hall(0.9, 0.9),
    "L": l_shaped,
    "warehouse": warehouse,
    "office": office,
    **{f"cluttered {seed}": cluttered(seed) for seed in range(4)},
}


def proposed(folder: Path, image: Pixels, **values: str) -> tuple[RobotMap, Proposal]:
    read = read_map(write_map(folder, image, **values))
    return read, propose_plant(read, SIZE, spacing=3.0, speed=1.0)


def on_paths(model: PlantModel) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Return places on all paths, at most 1 cm apart, m."""
    places = []
    for path in model.paths:
        ends = [model.point(name) for name in (path.source, path.destination)]
        start, end = (np.array((point.x_m, point.y_m)) for point in ends)
        count = 2 + int(hypot(*(end - start)) / 0.01)
        places.append(start + np.linspace(0, 1, count)[:, None] * (end - start))
    if not places:
        return np.array([(point.x_m, point.y_m) for point in model.points])
    return np.concatenate(places)


@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("origin", ["[0.0, 0.0, 0.0]", "[-7.5, 3.0, 0.4]"])
def test_robots_reach_all_places_and_keep_their_distance(tmp_path: Path, name: str, origin: str) -> None:
    read, proposal = proposed(tmp_path, MAPS[name](), origin=origin)
    model = proposal.model
    assert not find_fleet_errors(model)
    assert len({point.name for point in model.points}) == len(model.points) > 0
    places = on_paths(model)

    # No path is nearer to an obstacle than half the width and the clearance.
    solid = ~read.free & ndimage.binary_dilation(read.free, np.ones((3, 3)))
    middles = read.to_plane(np.argwhere(solid)[:, ::-1].astype(float))
    nearest = cKDTree(middles).query(places)[0] - CELL * hypot(0.5, 0.5)
    assert nearest.min() >= SIZE.width / 2 + SIZE.clearance - 0.002  # points are rounded to mm

    # Each place of a robot is at most 2 m from a path, and all points are reached from each.
    drivable = read.to_plane(np.argwhere(FreeSpace(read, SIZE).drivable)[:, ::-1].astype(float))
    assert cKDTree(places).query(drivable)[0].max() <= COVER + 0.002
    graph: rx.PyDiGraph[str, None] = rx.PyDiGraph()
    index = {point.name: graph.add_node(point.name) for point in model.points}
    graph.add_edges_from_no_data([(index[path.source], index[path.destination]) for path in model.paths])
    assert len(rx.strongly_connected_components(graph)) == 1


def one_way_paths(plant: PlantModel) -> list[PlantPath]:
    back = {(path.destination, path.source) for path in plant.paths}
    return [path for path in plant.paths if (path.source, path.destination) not in back]


def test_wide_aisles_get_a_lane_for_each_direction(tmp_path: Path) -> None:
    _, proposal = proposed(tmp_path, warehouse())
    assert proposal.one_way_pairs == 5
    assert len(one_way_paths(proposal.model)) > 20


def test_robots_do_not_meet_on_the_rings_of_a_room(tmp_path: Path) -> None:
    _, proposal = proposed(tmp_path, office())
    assert proposal.one_way_pairs == 0
    lanes = one_way_paths(proposal.model)
    assert len(lanes) >= 6 * 3
    assert max(path.length_mm for path in lanes) < 2500, "several queue to leave a room"


def test_long_narrow_corridor_gets_passing_places_where_there_is_room(tmp_path: Path) -> None:
    image = hall(40, 1.2, margin=3)
    _, without = proposed(tmp_path, image)
    assert without.passing_places == 0
    assert any("no room for two robots to pass" in each for each in without.remarks)
    block(image, 17, 2, 10, 1.1, 254)
    _, with_bay = proposed(tmp_path, image)
    assert with_bay.passing_places == 1
    assert not any("no room for two robots to pass" in each for each in with_bay.remarks)


def test_points_are_named_after_squares_and_rooms_without_a_door_are_told(tmp_path: Path) -> None:
    image = hall(14, 9)
    block(image, 10, 1, 0.2, 9)
    _, proposal = proposed(tmp_path, image, name="hall-3")
    assert {"A1", "B2"} <= {point.name for point in proposal.model.points}
    assert {point.map_id for point in proposal.model.points} == {"hall-3"}
    assert "33 m² around (12.6, 5.8) cannot be reached from the largest part" in proposal.remarks[0]


def test_map_without_room_for_the_robot_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RobotMapError, match=r"No place of map 'site' has room for a robot 0\.6 m wide"):
        proposed(tmp_path, hall(5, 0.5))


def test_parking_positions_leave_the_tracks_free(tmp_path: Path) -> None:
    _, proposal = proposed(tmp_path, warehouse())
    parking = [point for point in proposal.model.points if point.type == "PARK_POSITION"]
    assert len(parking) == len(proposal.parking) >= 3
    for point in parking:
        assert sum(path.destination == point.name for path in proposal.model.paths) == 1


def rough_office(seed: int, rough: float, specks: float) -> Pixels:
    """Return rooms in a ring of corridors; shares of the cells at walls and of others are occupied."""
    image, random = hall(30, 18), np.random.default_rng(seed)
    block(image, 4, 4, 24, 12)
    for number in range(4):
        for y, door in ((4.2, 4), (10.2, 15.7)):
            block(image, 4.2 + 5.9 * number, y, 5.7, 5.6, 254)
            block(image, 6.5 + 5.9 * number, door, 1, 0.4, 254)
    edge = ndimage.binary_dilation(image == 0) & (image == 254)
    image[edge & (random.random(image.shape) < rough)] = 0
    image[(image == 254) & (random.random(image.shape) < specks)] = 0
    return image


@pytest.mark.parametrize("seed", [0, 5])
def test_points_of_a_rough_map_are_apart(tmp_path: Path, seed: int) -> None:
    _, proposal = proposed(tmp_path, rough_office(seed, 0.2, 0.0003))
    places = np.array([(point.x_m, point.y_m) for point in proposal.model.points])
    assert cKDTree(places).query(places, k=2)[0][:, 1].min() > 0.2


@pytest.mark.parametrize("seed", [0, 4])
def test_nobody_drives_through_a_parking_position(tmp_path: Path, seed: int) -> None:
    _, proposal = proposed(tmp_path, rough_office(seed, 0.1, 0.001))
    parking = {point.name for point in proposal.parking}
    for place in parking:
        neighbours = {path.destination for path in proposal.model.paths if path.source == place}
        assert len(neighbours) == 1
        assert not neighbours & parking
