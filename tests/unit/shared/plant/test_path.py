import pytest
from pydantic import ValidationError

from nena_shared.plant import BACKWARD_SUFFIX, Orientation
from support.plants import path, plant


@pytest.mark.parametrize(
    ("forward", "reverse", "orientations"),
    [
        (1000, 0, [Orientation.FORWARD]),
        (0, 300, [Orientation.BACKWARD]),
        (1000, 300, [Orientation.FORWARD, Orientation.BACKWARD]),
        (0, 0, []),
    ],
)
def test_each_speed_gives_an_edge(forward: int, reverse: int, orientations: list[Orientation]) -> None:
    edges = path("A B", max_velocity_mm_s=forward, max_reverse_velocity_mm_s=reverse).edges()
    assert [edge.orientation for edge in edges] == orientations


def test_the_edges_of_a_path_lead_both_ways() -> None:
    model = plant(path("A B", max_velocity_mm_s=1500, max_reverse_velocity_mm_s=300))
    forward = model.edges_by_id["A --- B"]
    backward = model.edges_by_id["A --- B" + BACKWARD_SUFFIX]
    assert (forward.source, forward.destination, forward.max_velocity_m_s) == ("A", "B", 1.5)
    assert (backward.source, backward.destination, backward.max_velocity_m_s) == ("B", "A", 0.3)
    assert forward.path is backward.path


def test_a_locked_path_keeps_its_edges() -> None:
    assert len(list(path("A B", locked=True).edges())) == 1


def test_a_length_is_at_least_a_millimetre() -> None:
    with pytest.raises(ValidationError, match="length_mm"):
        path("A B", 0)
