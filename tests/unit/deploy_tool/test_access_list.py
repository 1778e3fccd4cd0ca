from __future__ import annotations

from nena_deploy.access_list import access_list
from nena_deploy.identity import Identity, Kind
from nena_deploy.topics import SiteTopics


def rules_of(kind: Kind, name: str) -> list[str]:
    text = access_list([Identity(kind=kind, name=name, certificate=1)], SiteTopics())
    head, user, *rules = [line for line in text.splitlines() if line]
    assert head.startswith("#")
    assert user == f"user {name}"
    return [each.removeprefix("topic ") for each in rules]


def test_a_robot_writes_what_robots_write_and_reads_what_is_for_it_alone() -> None:
    rules = rules_of(Kind.ROBOT, "ACME/1")

    assert "write uagv/v2/ACME/1/state" in rules
    assert "write vda5050/v3/ACME/1/connection" in rules
    assert "read uagv/v2/ACME/1/order" in rules
    assert "read vda5050/v3/ACME/1/zoneSet" in rules
    assert "write uagv/v2/ACME/1/nena/#" in rules
    assert [each for each in rules if "ACME/1" not in each] == ["read nena/v1/plantModel"]
    assert not [each for each in rules if each.startswith("readwrite")]


def test_a_host_speaks_under_its_own_name() -> None:
    rules = rules_of(Kind.HOST, "wms")

    assert [each for each in rules if "write" in each] == [
        "write nena/v1/hosts/wms/transportOrders/create",
        "write nena/v1/hosts/wms/commands/delivery",
    ]
    assert "read nena/v1/hosts/wms/#" in rules
    assert not [each for each in rules if "uagv" in each or "vda5050" in each]


def test_only_the_order_service_writes_orders() -> None:
    assert "write uagv/v2/+/+/order" in rules_of(Kind.ORDER_SERVICE, "order-service")
    assert all(each.startswith("read ") for each in rules_of(Kind.STATUS_AGGREGATOR, "status-aggregator"))


def test_topics_are_those_of_the_site() -> None:
    topics = SiteTopics(interface_name="site/hall", interface_name_v3="site/v3", prefix="site/nena")
    text = access_list([Identity(kind=Kind.ROBOT, name="A/1", certificate=1)], topics)

    assert "topic write site/hall/v2/A/1/state\n" in text
    assert "topic write site/v3/v3/A/1/state\n" in text
    assert "topic read site/nena/plantModel\n" in text
