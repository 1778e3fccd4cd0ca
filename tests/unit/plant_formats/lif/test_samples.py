"""The guideline's own examples, where they are at hand."""

from __future__ import annotations

import pytest

from nena_plant_formats.lif import read
from nena_shared.plant import PlantModelError
from support.reference import reference_dir

CHARGING = "vdma-10.13-charging-station.lif.json"
LEVELS = "vdma-10.14-two-levels.lif.json"


def sample(name: str) -> bytes:
    return reference_dir("lif-samples", name).read_bytes()


@pytest.mark.parametrize("name", [CHARGING, LEVELS])
def test_no_sample_fits_the_schema(name: str) -> None:
    with pytest.raises(PlantModelError) as caught:
        read(sample(name), strict=True)
    assert {problem.code for problem in caught.value.problems} == {"NOT_LIF"}


def test_the_levels_are_joined_by_edges() -> None:
    model = read(sample(LEVELS)).model
    assert {point.map_id for point in model.points} == {"Map_Z-Level_1", "Map_Z-Level_2"}
    assert (model.path("N2-N102").source, model.path("N2-N102").destination) == ("N2", "N102")
    assert model.visual_layout.properties["lif:layout.1.levelId"] == "1"
