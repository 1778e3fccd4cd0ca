from __future__ import annotations

import pytest

from nena_edge_agent.ros.address import BadAddressError, RosAddress
from nena_edge_agent.ros.settings import RosSettings

HERE = RosAddress("/r1", 7)


def test_what_is_not_given_stays() -> None:
    assert HERE.changed(namespace="hall/r2") == RosAddress("/hall/r2", 7)
    assert HERE.changed(domain_id=0) == RosAddress("/r1", 0)
    assert str(HERE) == "namespace /r1, domain 7"


@pytest.mark.parametrize(
    ("namespace", "domain_id", "problem"),
    [
        ("r-1", None, "namespace: .*letters, digits and underscores"),
        ("2nd", None, "no part starts with a digit"),
        (None, 233, "domain_id: .*less than or equal to 232"),
        (None, -1, "greater than or equal to 0"),
    ],
)
def test_what_ros_would_refuse_or_die_of_is_refused(
    namespace: str | None, domain_id: int | None, problem: str
) -> None:
    with pytest.raises(BadAddressError, match=problem):
        HERE.changed(namespace=namespace, domain_id=domain_id)


def test_settings_take_it_in_place_of_their_own() -> None:
    settings = RosSettings(namespace="/old", domain_id=1, frame="world")
    moved = HERE.applied(settings)
    assert RosAddress.of(moved) == HERE
    assert moved.frame == "world"
    assert RosAddress.of(settings) == RosAddress("/old", 1)
