from __future__ import annotations

import re

import pytest

from nena_deploy.identities import (
    Identity,
    IdentityError,
    Kind,
    SiteTopics,
    access_list,
    device_name,
    host_name,
    robot_name,
)
from nena_order_service.api.asyncapi import channels
from nena_shared.fleet_api.topics import FleetTopics


@pytest.mark.parametrize(
    "level", ["", "a/b", "a+", "#", "a\n", "../x", ".", "$SYS", "x" * 65, " a", "a ", " ", "a\x7f"]
)
def test_name_must_be_valid_in_a_topic(level: str) -> None:
    with pytest.raises(IdentityError, match=r"manufacturer .* is not valid in a topic"):
        robot_name(level, "1")
    with pytest.raises(IdentityError, match=r"serial number .* is not valid in a topic"):
        robot_name("A", level)
    with pytest.raises(IdentityError, match=r"name .* is not valid in a topic"):
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
    with pytest.raises(IdentityError, match="name of a service"):
        host_name(name)


def rules_of(kind: Kind, name: str) -> list[str]:
    text = access_list([Identity(kind=kind, name=name, certificate=1)], SiteTopics())
    head, user, *rules = [line for line in text.splitlines() if line]
    assert head.startswith("#")
    assert user == f"user {name}"
    return [each.removeprefix("topic ") for each in rules]


def test_robot_writes_and_reads_only_its_own_topics() -> None:
    rules = rules_of(Kind.ROBOT, "ACME/1")

    assert "write uagv/v2/ACME/1/state" in rules
    assert "write vda5050/v3/ACME/1/connection" in rules
    assert "read uagv/v2/ACME/1/order" in rules
    assert "read vda5050/v3/ACME/1/zoneSet" in rules
    assert "write nena/v1/robots/ACME/1/map" in rules
    assert "write nena/v1/robots/ACME/1/recordings/chunk" in rules
    assert "read nena/v1/robots/ACME/1/recordings/answer" in rules
    assert not [each for each in rules if "#" in each or "+" in each], "each topic by its name"
    assert [each for each in rules if "ACME/1" not in each] == ["read nena/v1/plantModel"]
    assert not [each for each in rules if each.startswith("readwrite")]


def test_host_publishes_under_its_own_name() -> None:
    rules = rules_of(Kind.HOST, "wms")

    assert [each for each in rules if "write" in each] == [
        "write nena/v1/hosts/wms/transportOrders/create",
        "write nena/v1/hosts/wms/commands/delivery",
    ]
    assert "read nena/v1/hosts/wms/#" in rules
    assert not [each for each in rules if "uagv" in each or "vda5050" in each]


def test_host_reads_each_status_of_the_mqtt_api() -> None:
    published = [each for each in channels(FleetTopics()) if each.action == "send" and each.retained]
    topics = [re.sub(r"{\w+}", "+", each.address) for each in published]
    assert len(topics) > 3
    assert {f"read {topic}" for topic in topics} <= {*rules_of(Kind.HOST, "wms")}


def test_a_device_takes_the_jobs_of_its_location() -> None:
    assert rules_of(Kind.DEVICE, device_name("Door 1")) == [
        "write nena/v1/peripherals/Door%201/jobState",
        "write nena/v1/peripherals/Door%201/state",
        "read nena/v1/peripherals/Door%201/job",
        "read nena/v1/peripherals/Door%201/cancel",
    ]
    with pytest.raises(IdentityError):
        device_name("+")


def test_only_the_order_service_writes_orders() -> None:
    assert "write uagv/v2/+/+/order" in rules_of(Kind.ORDER_SERVICE, "order-service")
    rules = rules_of(Kind.STATUS_AGGREGATOR, "status-aggregator")
    assert [each for each in rules if not each.startswith("read ")] == [
        "write nena/v1/robots/+/+/recordings/answer",
        "write nena/v1/acknowledgements/+",
        "write nena/v1/directStops/+",
        "write uagv/v2/+/+/instantActions",
        "write vda5050/v3/+/+/instantActions",
    ]
