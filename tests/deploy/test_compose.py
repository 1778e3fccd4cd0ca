"""docker-compose up, for real: images from this tree, a simulated robot's order, a crash, an orderly end."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from support.compose import BUILD_SECONDS, IN_POSTGRESQL, Compose, read, skip_without_docker
from support.waiting import until

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(BUILD_SECONDS)]

DEFAULT = {"broker", "order-service", "status-aggregator", "prometheus", "alertmanager"}
ROBOTS = {"robot-simulator", "robot-01", "robot-02"}
OURS = (DEFAULT | ROBOTS) - {"broker", "prometheus", "alertmanager"}
ALL = DEFAULT | ROBOTS | {"postgres"}
PROFILES = ("--profile", "demo", "--profile", "postgres")
CARRY = (("Goods in", "Load cargo"), ("Storage", "Unload cargo"))
ORDER_WITHIN = 180.0


@pytest.fixture(scope="module")
def compose() -> Iterator[Compose]:
    """Yield the stack with every profile, after checking the images of the default one."""
    skip_without_docker()
    project = Compose(IN_POSTGRESQL)
    try:
        project.run("--profile", "demo", "build", "--quiet", timeout=BUILD_SECONDS)
        project.run("up", "--detach")
        assert set(project.containers()) == DEFAULT
        project.run(*PROFILES, "up", "--detach")
        yield project
    finally:
        project.close()


@pytest.fixture
async def healthy(compose: Compose) -> Compose:
    """Return the stack once every health check succeeds."""
    await compose.all_healthy(ALL)
    return compose


async def order_ended(compose: Compose, name: str) -> dict[str, Any]:
    final = {"FINISHED", "FAILED", "UNROUTABLE"}

    def ended() -> dict[str, Any] | None:
        order = compose.order(name)
        return order if order and order["state"] in final else None

    return await until(ended, timeout=ORDER_WITHIN, what=f"the end of {name}")


async def stored(compose: Compose, statement: str, row: str) -> None:
    """Wait until the database of both services has a row."""

    def rows() -> list[str]:
        done = compose.execute("postgres", "psql", "-U", "nena", "-d", "nena", "-Atc", statement)
        assert done.returncode == 0, done.stderr
        return done.stdout.splitlines()

    await until(lambda: row in rows(), what=f"{row} among what {statement!r} gives")


async def test_robot_in_a_container_executes_a_transport_order(healthy: Compose) -> None:
    name = healthy.create(*CARRY)

    order = await order_ended(healthy, name)

    assert order["state"] == "FINISHED", order["reason"]
    assert order["processingVehicle"] in ("Robot-01", "Robot-02")


async def test_orders_survive_a_crash_of_the_order_service(healthy: Compose) -> None:
    name = healthy.create(("Packing", "Load cargo"))

    healthy.run("kill", "-s", "SIGKILL", "order-service")
    healthy.run("up", "--detach", "order-service")

    order = await order_ended(healthy, name)
    assert order["state"] == "FINISHED", order["reason"]


@pytest.mark.usefixtures("healthy")
def test_commands_need_the_token(compose: Compose) -> None:
    for port, path in (("REST_PORT", "/v1/transportOrders"), ("PANEL_PORT", "/api/v1/fleet")):
        assert httpx.get(compose.url(port) + path, timeout=10.0).status_code == 401
        assert httpx.get(compose.url(port) + path, headers=compose.login, timeout=10.0).status_code == 200


async def test_panel_and_prometheus_see_the_robots(healthy: Compose) -> None:
    fleet = await until(
        lambda: (found := healthy.read("PANEL_PORT", "/api/v1/fleet")) and found["robots"] and found
    )
    assert {robot["serialNumber"] for robot in fleet["robots"]} >= {"robot-01", "robot-02"}
    url = f"{healthy.url('PROMETHEUS_PORT')}/api/v1/targets"
    await until(
        lambda: (
            (found := read(url)) and {each["health"] for each in found["data"]["activeTargets"]} == {"up"}
        ),
        timeout=60,
        what="Prometheus reads every target",
    )


async def test_prometheus_has_the_rules(healthy: Compose) -> None:
    def groups() -> list[dict[str, Any]]:
        found = read(f"{healthy.url('PROMETHEUS_PORT')}/api/v1/rules")
        return found["data"]["groups"] if found else []

    rules = [rule for group in await until(groups) for rule in group["rules"]]

    assert {rule["type"] for rule in rules} == {"alerting", "recording"}


async def test_prometheus_sends_to_alertmanager(healthy: Compose) -> None:
    url = f"{healthy.url('PROMETHEUS_PORT')}/api/v1/alertmanagers"
    await until(
        lambda: (found := read(url)) and found["data"]["activeAlertmanagers"], what="Alertmanager is found"
    )


async def test_doctor_reports_a_healthy_robot(healthy: Compose) -> None:
    done = healthy.execute("robot-01", "nena-edge-agent", "doctor", "--config", "/etc/nena/agent.toml")

    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.endswith("No link is missing.\n")


def test_the_page_is_served(compose: Compose) -> None:
    page = httpx.get(f"{compose.url('PANEL_PORT')}/", timeout=10.0)

    assert page.is_success
    assert page.headers["content-type"].startswith("text/html")


async def test_orders_and_history_are_in_postgresql(healthy: Compose) -> None:
    name = healthy.create(*CARRY)

    assert (await order_ended(healthy, name))["state"] == "FINISHED"

    await stored(healthy, "select name, state from transport_orders", f"{name}|FINISHED")
    await stored(healthy, "select distinct order_name from happenings", name)


async def test_lost_database_is_restored_from_a_backup(healthy: Compose, tmp_path: Path) -> None:
    """By the commands of docs/operations.md for the container."""
    before = healthy.create(*CARRY)
    assert (await order_ended(healthy, before))["state"] == "FINISHED"
    await stored(healthy, "select name, state from transport_orders", f"{before}|FINISHED")
    healthy.follow("operations.md", "postgres pg_dump", tmp_path)
    healthy.lose_volume("postgres", "database")
    healthy.run(*PROFILES, "up", "--detach", "postgres")
    await until(lambda: healthy.health()["postgres"] == "healthy", what="an empty database is there")

    healthy.follow("operations.md", "postgres pg_restore", tmp_path)
    healthy.run(*PROFILES, "up", "--detach")
    await healthy.all_healthy(ALL)

    order = healthy.order(before)
    assert order
    assert order["state"] == "FINISHED"
    order = await order_ended(healthy, healthy.create(*CARRY))
    assert order["state"] == "FINISHED", order["reason"]


async def test_database_requires_its_password(healthy: Compose) -> None:
    connect = "psql -h 127.0.0.1 -U nena -d nena -Atc 'select 1'"
    with_password = healthy.execute("postgres", "sh", "-c", f"PGPASSWORD={healthy.password} {connect}")
    without = healthy.execute("postgres", "sh", "-c", f"PGPASSWORD=wrong {connect}")

    assert with_password.stdout.strip() == "1", with_password.stderr
    assert without.returncode != 0


@pytest.mark.parametrize("service", sorted(OURS))
async def test_containers_are_restricted(healthy: Compose, service: str) -> None:
    container = healthy.containers()[service]
    host = container["HostConfig"]

    assert host["ReadonlyRootfs"] is True
    assert host["CapDrop"] == ["ALL"]
    assert healthy.execute(service, "id", "-u").stdout.strip() == "10001"
    assert healthy.execute(service, "touch", "/opt/nena/x").returncode != 0
    assert healthy.execute(service, "touch", "/tmp/x").returncode == 0  # noqa: S108 - the container's own
    status = healthy.execute(service, "cat", "/proc/1/status").stdout
    assert "CapEff:\t0000000000000000" in status
    assert "NoNewPrivs:\t1" in status


async def test_services_listen_on_loopback_only(healthy: Compose) -> None:
    bindings = [
        binding
        for container in healthy.containers().values()
        for each in container["HostConfig"]["PortBindings"].values()
        for binding in each
    ]

    assert len(bindings) == 4
    assert {binding["HostIp"] for binding in bindings} == {"127.0.0.1"}


async def test_a_robot_with_a_hanging_program_is_unhealthy(healthy: Compose) -> None:
    """Run before the last test: it leaves one robot unhealthy."""
    healthy.run("kill", "-s", "SIGSTOP", "robot-02")

    await until(lambda: healthy.health()["robot-02"] == "unhealthy", timeout=90, what="robot-02 is unhealthy")

    healthy.run("kill", "-s", "SIGCONT", "robot-02")


async def test_all_containers_stop_cleanly(healthy: Compose) -> None:
    healthy.run(*PROFILES, "stop")

    containers = healthy.containers()
    assert {name: containers[name]["State"]["ExitCode"] for name in OURS} == dict.fromkeys(OURS, 0)
