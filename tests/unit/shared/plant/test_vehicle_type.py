from __future__ import annotations

from math import pi

import pytest

from nena_shared.plant.vehicle_type import LoadRestriction, OrientationType, VehicleTypeOnPath


@pytest.mark.parametrize(
    ("orientation", "kind", "backward"),
    [
        (None, OrientationType.TANGENTIAL, False),
        (0.0, OrientationType.TANGENTIAL, False),
        (pi, OrientationType.TANGENTIAL, True),
        (pi / 4, OrientationType.TANGENTIAL, False),
        (pi, OrientationType.GLOBAL, False),
    ],
)
def test_who_looks_against_the_direction_of_the_path_drives_backward(
    orientation: float | None, kind: OrientationType, *, backward: bool
) -> None:
    use = VehicleTypeOnPath(
        vehicle_type_id="t", rotation_allowed=True, vehicle_orientation=orientation, orientation_type=kind
    )
    assert use.is_backward is backward


@pytest.mark.parametrize(("loaded", "allowed"), [(True, False), (False, True), (None, True)])
def test_a_restriction_counts_where_it_is_known_whether_there_is_a_load(
    *, loaded: bool | None, allowed: bool
) -> None:
    use = VehicleTypeOnPath(
        vehicle_type_id="t",
        rotation_allowed=True,
        load_restriction=LoadRestriction(unloaded=True, loaded=False),
    )
    assert use.allows(loaded=loaded) is allowed


def test_without_a_restriction_every_load_may_pass() -> None:
    assert VehicleTypeOnPath(vehicle_type_id="t", rotation_allowed=True).allows(loaded=True)
