from __future__ import annotations

import pytest

from nena_deploy.identity import Identity, IdentityError, Kind, host_name, robot_name


def test_a_robot_is_called_as_in_its_topics() -> None:
    assert robot_name("ACME Robots", "AGV-0001") == "ACME Robots/AGV-0001"


@pytest.mark.parametrize(
    "level", ["", "a/b", "a+", "#", "a\n", "../x", ".", "$SYS", "x" * 65, " a", "a ", " ", "a\x7f"]
)
def test_what_cannot_stand_in_a_topic_is_no_name(level: str) -> None:
    with pytest.raises(IdentityError, match=r"manufacturer .* cannot stand in a topic"):
        robot_name(level, "1")
    with pytest.raises(IdentityError, match=r"serial number .* cannot stand in a topic"):
        robot_name("A", level)
    with pytest.raises(IdentityError, match=r"name .* cannot stand in a topic"):
        host_name(level)


def test_both_parts_together_fit_into_a_certificate() -> None:
    assert len(robot_name("m" * 32, "s" * 31)) == 64
    with pytest.raises(IdentityError, match="too long"):
        robot_name("m" * 32, "s" * 32)
    with pytest.raises(IdentityError, match="too long"):
        robot_name("ä" * 20, "ö" * 20)
    with pytest.raises(IdentityError, match="too long"):
        host_name("ü" * 33)


@pytest.mark.parametrize("name", ["order-service", "status-aggregator"])
def test_no_host_has_the_name_of_a_service(name: str) -> None:
    with pytest.raises(IdentityError, match="a service's name"):
        host_name(name)


@pytest.mark.parametrize(
    ("kind", "name", "folder"),
    [
        (Kind.ROBOT, "ACME/1", "robots/ACME/1"),
        (Kind.HOST, "wms", "hosts/wms"),
        (Kind.ORDER_SERVICE, "order-service", "order-service"),
    ],
)
def test_each_has_a_folder(kind: Kind, name: str, folder: str) -> None:
    assert Identity(kind=kind, name=name, certificate=1).folder == folder
