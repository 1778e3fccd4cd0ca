"""Rules and dashboards against a real Prometheus that scrapes a real aggregator."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from nena_shared.fleet_api.service_status import ServiceStatus
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_status_aggregator.settings import HistorySettings
from support.broker import Broker, MqttPeer
from support.certificates import Authority
from support.fleet_examples import ROBOT, START, connection, order_status, position, state, way
from support.order_service_fleet import Fleet, running
from support.prometheus import (
    CONFIGURATION,
    DASHBOARDS,
    GRAFANA,
    Prometheus,
    dashboard_queries,
    eventually,
    program,
)
from support.reference import PROJECT
from support.served_aggregator import Served, serving
from support.waiting import PATIENCE

NAME = re.compile(r"\bnena_\w+")
BLOCKED = RobotKey("ACME", "r2")


def promtool(*arguments: str) -> None:
    checked("promtool", *arguments)


def checked(name: str, *arguments: str) -> None:
    done = subprocess.run(
        [program(name), *arguments], capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_configuration_and_rules_are_valid() -> None:
    promtool("check", "config", str(CONFIGURATION / "prometheus.yml"))
    promtool("check", "rules", *map(str, sorted((CONFIGURATION / "rules").glob("*.yml"))))


@pytest.mark.parametrize("with_receivers", [False, True])
def test_alertmanager_knows_its_receivers(tmp_path: Path, *, with_receivers: bool) -> None:
    text = (CONFIGURATION / "alertmanager.yml").read_text(encoding="utf-8")
    if with_receivers:
        text = re.sub(r"(?m)^    # ( *(?:\w+_configs:|- {))", r"    \1", text)
        assert text.count("_configs:") == 2
    file = tmp_path / "alertmanager.yml"
    file.write_text(text, encoding="utf-8")
    checked("amtool", "check-config", str(file))


def test_the_configurations_of_containers_are_in_order(tmp_path: Path) -> None:
    containers = CONFIGURATION.parent / "containers"
    shutil.copytree(CONFIGURATION / "rules", tmp_path / "rules")
    shutil.copy(Authority(tmp_path).ca, tmp_path / "ca.pem")
    for name in ("prometheus.yml", "prometheus.site.yml"):
        shutil.copy(containers / name, tmp_path)
        promtool("check", "config", str(tmp_path / name))


@pytest.mark.parametrize("file", sorted((CONFIGURATION / "tests").glob("*.yml")), ids=lambda file: file.name)
def test_rules_record_and_alert_as_they_should(file: Path) -> None:
    promtool("test", "rules", str(file))


def test_every_recording_rule_has_a_test() -> None:
    rules = (CONFIGURATION / "rules" / "recording.yml").read_text(encoding="utf-8")
    tests = "".join(file.read_text(encoding="utf-8") for file in (CONFIGURATION / "tests").glob("*.yml"))
    checked = set(re.findall(r"expr: .*?(nena:[\w:]+).*exp_samples: \[\{", tests))
    assert set(re.findall(r"- record: (\S+)", rules)) == checked


def test_every_alert_has_a_test_and_says_what_to_do() -> None:
    rules = (CONFIGURATION / "rules" / "alerts.yml").read_text(encoding="utf-8")
    tests = "".join(file.read_text(encoding="utf-8") for file in (CONFIGURATION / "tests").glob("*.yml"))
    names = re.findall(r"- alert: (\w+)", rules)
    fired = re.findall(r"alertname: (\w+)\n +exp_alerts:\n", tests)
    assert set(names) == set(fired)
    assert rules.count("description:") == rules.count("severity:") == len(names)


def test_every_alert_has_an_entry_in_the_runbook_to_which_it_points() -> None:
    rules = (CONFIGURATION / "rules" / "alerts.yml").read_text(encoding="utf-8")
    names = re.findall(r"- alert: (\w+)", rules)
    runbook = (PROJECT / "docs" / "runbook.md").read_text(encoding="utf-8")
    entries = dict(re.findall(r"^### (\w+)\n(.*?)(?=^##|\Z)", runbook, re.MULTILINE | re.DOTALL))
    assert sorted(entries) == sorted(names)
    for name, entry in entries.items():
        assert re.findall(r"^\*\*(\w+)\.\*\*", entry, re.MULTILINE) == [
            "Meaning",
            "Diagnosis",
            "Mitigation",
        ], name
    pointers = re.findall(r'runbook_url: "{{ \$externalLabels.nena_runbook }}#(\w+)"', rules)
    assert pointers == [name.lower() for name in names]


def test_rules_and_dashboards_use_existing_metrics() -> None:
    documented = set(NAME.findall((PROJECT / "docs" / "metrics.md").read_text(encoding="utf-8")))
    for file in (*DASHBOARDS, *sorted((CONFIGURATION / "rules").glob("*.yml"))):
        used = {name.removesuffix("_bucket") for name in NAME.findall(file.read_text(encoding="utf-8"))}
        assert used <= documented, file.name


def test_dashboards_are_provisioned_over_one_source() -> None:
    source = (GRAFANA / "provisioning" / "datasources" / "nena.yml").read_text(encoding="utf-8")
    boards = [json.loads(file.read_text(encoding="utf-8")) for file in DASHBOARDS]
    assert [board["uid"] for board in boards] == [file.stem for file in DASHBOARDS]
    for board in boards:
        assert {panel["datasource"]["uid"] for panel in board["panels"]} == {"nena-prometheus"}
        assert len({panel["id"] for panel in board["panels"]}) == len(board["panels"])
    assert "uid: nena-prometheus" in source


def say_everything(served: Served, peer: MqttPeer, turn: int) -> None:
    """Make two robots and the order service send one message of each kind."""
    order = f"v{turn}"
    power = {"state_of_charge": 55.0, "charging": False, "battery_voltage": 48.0, "range": 900.0}
    error = {"error_type": "orderError", "error_level": "WARNING", "error_references": ()}
    common: dict[str, Any] = {
        "power_supply": power,
        "velocity": {"vx": 1.0},
        "loads": ({"load_id": "box"},),
        "paused": False,
    }
    action = {"action_id": f"a{turn}", "action_type": "pick", "action_status": "RUNNING"}
    scenes: tuple[dict[str, Any], ...] = (
        {"last_node_id": "A", "mobile_robot_position": position(0, 0)},
        {"order_id": order, "last_node_id": "A", "action_states": (action,), **way("B")},
        {
            "order_id": order,
            "last_node_id": "B",
            "last_node_sequence_id": 2,
            "action_states": ({**action, "action_status": "FINISHED"},),
            "mobile_robot_position": position(3, 0),
            "errors": (error,),
        },
    )
    served.send(peer, Topic.CONNECTION, connection(number=turn, at=turn * 10.0))
    for step, scene in enumerate(scenes):
        number = turn * 10 + step
        served.send(peer, Topic.STATE, state(number, at=number, **common, **scene))
    stop = {"active_emergency_stop": "MANUAL", "field_violation": False}
    blocked = state(turn * 10, at=turn * 10, robot=BLOCKED, safety_state=stop)
    served.send(peer, Topic.STATE, blocked, robot=BLOCKED)
    ended = order_status(
        f"TO-{turn}", state=TransportOrderState.FINISHED, finished=START + timedelta(seconds=45)
    )
    alive = ServiceStatus(online=True, timestamp=datetime.now(UTC), store_ready=True)
    peer.publish(served.fleet.service_status, alive.model_dump_json(by_alias=True))
    for status in (ended, order_status(f"TO-living-{turn}")):
        peer.publish(served.fleet.order_status(status.name), status.model_dump_json(by_alias=True))


@pytest.mark.broker
async def test_every_query_of_rules_and_dashboards_returns_data(
    broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    history = HistorySettings.model_validate({"url": f"sqlite:///{tmp_path / 'history.db'}"})
    orders = Fleet(broker, interface_name, tmp_path).settings()
    async with serving(broker, interface_name, history=history) as served, running(orders):
        address = served.http.base_url.netloc.decode()
        async with Prometheus(
            tmp_path, address, order_services=[f"127.0.0.1:{orders.http.port}"]
        ) as prometheus:
            with MqttPeer(broker) as peer:
                say_everything(served, peer, 1)
                ended = 'nena_transport_orders_ended_total{state="FINISHED"}'
                await eventually(lambda: prometheus.query(f"{ended} == 1"), "the first scrape")
                say_everything(served, peer, 2)
                await eventually(lambda: prometheus.query(f"{ended} == 2"), "a later scrape")
            for panel, expression in dashboard_queries(ROBOT):
                await eventually(partial(prometheus.query, expression), f"{panel}: {expression}")
            rules = await eventually(lambda: evaluated(prometheus), "all rules evaluated")
            for rule in rules:
                assert rule["health"] == "ok", f"{rule['name']}: {rule.get('lastError')}"
                if rule["type"] == "recording":
                    await eventually(partial(prometheus.query, rule["name"]), rule["name"])
            alert = 'ALERTS{alertname="NenaRobotStands"}'
            (stands,) = await eventually(partial(prometheus.query, alert), alert)
            assert stands["metric"]["serial_number"] == BLOCKED.serial_number
            told = f'nena_robot_condition{{serial_number="{ROBOT.serial_number}"}}'
            condition = await eventually(partial(prometheus.query, told), told)
            assert condition[0]["metric"]["manufacturer"] == ROBOT.manufacturer


async def evaluated(prometheus: Prometheus) -> list[dict[str, Any]]:
    """Return the rules once all of them have been evaluated."""
    rules = await prometheus.rules()
    return [] if any(rule["health"] == "unknown" for rule in rules) else rules
