from nena_shared.plant import PlantModel
from nena_shared.plant.connectivity import cut_off_points
from support.plants import grid_plant, path, plant


def test_a_ring_is_connected() -> None:
    assert cut_off_points(plant(path("A B"), path("B C"), path("C A"))) == ()


def test_a_dead_end_is_not() -> None:
    assert cut_off_points(plant(path("A B"), path("B C"), path("C A"), path("B D"))) == ("D",)


def test_a_reverse_speed_leads_out_of_a_dead_end() -> None:
    model = plant(path("A B"), path("B A"), path("B D", max_reverse_velocity_mm_s=300))
    assert cut_off_points(model) == ()


def test_a_locked_path_leads_nowhere() -> None:
    assert cut_off_points(plant(path("A B"), path("B A"), path("B C"), path("C B", locked=True))) == ("C",)


def test_the_smaller_part_is_the_one_cut_off() -> None:
    grid = grid_plant(3, 3)
    island = plant(path("X Y"), path("Y X"))
    model = PlantModel(name="both", points=(*island.points, *grid.points), paths=(*island.paths, *grid.paths))
    assert cut_off_points(model) == ("X", "Y")


def test_an_empty_model_has_nothing_to_cut_off() -> None:
    assert cut_off_points(PlantModel(name="empty")) == ()
