from __future__ import annotations

import pytest

from nena_robot_simulator.error_code import of_several


@pytest.mark.parametrize(("code", "expected"), [(208, 308), (204, 304), (105, 105), (0, 0), (309, 309)])
def test_only_the_codes_of_the_planner_have_a_twin_for_several_places(code: int, expected: int) -> None:
    assert of_several(code) == expected
