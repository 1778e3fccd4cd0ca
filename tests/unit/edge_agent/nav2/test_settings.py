from __future__ import annotations

import pytest
from pydantic import ValidationError

from nena_edge_agent.nav2.settings import (
    BadAddressError,
    Navigation,
    RosAddress,
    RosNames,
    RosSettings,
    status_of,
)


@pytest.mark.parametrize(
    ("given", "kept"), [("", "/"), ("/", "/"), ("r1", "/r1"), ("/r1", "/r1"), ("hall_2/r1", "/hall_2/r1")]
)
def test_namespace_has_one_form(given: str, kept: str) -> None:
    assert RosSettings(namespace=given).namespace == kept


@pytest.mark.parametrize("namespace", ["robot-1", "1r", "r1/", "a//b", "a b", "r.1", "//r1"])
def test_namespace_that_ros_would_refuse(namespace: str) -> None:
    with pytest.raises(ValidationError, match="letters, digits and underscores"):
        RosSettings(namespace=namespace)


@pytest.mark.parametrize("domain_id", [-1, 233])
def test_domain_id_that_would_end_the_process(domain_id: int) -> None:
    with pytest.raises(ValidationError):
        RosSettings(domain_id=domain_id)


@pytest.mark.parametrize(
    ("navigation", "driven", "other", "only"),
    [
        (Navigation.AUTO, "drive/to", "drive/through", False),
        (Navigation.TOPICS, "drive/to", "drive/through", False),
        (Navigation.ACTION, "drive/to", "drive/through", True),
        (Navigation.THROUGH_POSES, "drive/through", "drive/to", True),
    ],
)
def test_the_configured_action_drives(navigation: Navigation, driven: str, other: str, *, only: bool) -> None:
    names = RosNames(action="drive/to", through_poses="drive/through")
    settings = RosSettings(names=names, navigation=navigation)
    assert (settings.action, settings.other_action, settings.by_action_only) == (driven, other, only)
    assert status_of(settings.action) == f"{driven}/_action/status"


@pytest.mark.parametrize("name", ["battery-state", "", "a//b", "~/x"])
def test_name_that_ros_would_refuse(name: str) -> None:
    with pytest.raises(ValidationError):
        RosNames(battery=name)


def test_node_name_that_ros_would_refuse() -> None:
    with pytest.raises(ValidationError):
        RosSettings(node_name="agent/1")


HERE = RosAddress("/r1", 7)


def test_omitted_parts_are_kept() -> None:
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
def test_addresses_invalid_in_ros_are_refused(
    namespace: str | None, domain_id: int | None, problem: str
) -> None:
    with pytest.raises(BadAddressError, match=problem):
        HERE.changed(namespace=namespace, domain_id=domain_id)


def test_an_address_replaces_that_of_the_settings() -> None:
    settings = RosSettings(namespace="/old", domain_id=1, frame="world")
    moved = HERE.applied(settings)
    assert RosAddress.of(moved) == HERE
    assert moved.frame == "world"
    assert RosAddress.of(settings) == RosAddress("/old", 1)
