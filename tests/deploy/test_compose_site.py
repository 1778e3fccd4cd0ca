"""A site by docker-compose as docs/installation.md makes it: by TLS, with identities of nena-deploy."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from nena_shared.settings import MqttSettings, MqttTlsSettings
from support.compose import BUILD_SECONDS, Compose, read, skip_without_docker
from support.guides import commands
from support.running_site import Client, connected, identity_in
from support.waiting import until

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(BUILD_SECONDS)]

SERVICES = {"broker", "order-service", "status-aggregator", "prometheus", "alertmanager"}
FILES = "docker-compose.yml:docker-compose.site.yml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the site."""
    return tmp_path_factory.mktemp("nena") / "site"


@pytest.fixture(scope="module")
def compose(folder: Path) -> Iterator[Compose]:
    """Yield a site made by the guide's commands."""
    skip_without_docker()
    if os.geteuid():
        pytest.skip("gives files to users of containers, which only root may")
    export, made = commands("installation.md", "$SITE --host").split("\n", maxsplit=1)
    assert export.endswith(f"COMPOSE_FILE={FILES}")
    project = Compose({"SITE": str(folder), "COMPOSE_FILE": FILES, "MQTTS_ADDRESS": "127.0.0.1"})
    try:
        project.run("build", "--quiet", timeout=BUILD_SECONDS)
        project.shell(made.replace("broker.example", "localhost"))
        yield project
    finally:
        project.close()


@pytest.fixture
async def healthy(compose: Compose) -> Compose:
    await compose.all_healthy(SERVICES)
    return compose


def client_at(compose: Compose, port: str, tls: MqttTlsSettings) -> Client:
    """Return a client that tries to connect to the site's broker, for the plant model."""
    settings = MqttSettings(
        host="localhost", port=compose.ports[port], tls=tls, reconnect_min=0.05, reconnect_max=0.2
    )
    return Client(settings, "nena-test", "nena/v1/plantModel")


async def test_services_and_clients_connect_with_certificates(healthy: Compose, folder: Path) -> None:
    async with connected(
        client_at(healthy, "MQTTS_PORT", identity_in(folder / "hosts" / "health"))
    ) as client:
        await until(lambda: client.came, what="the plant model comes from the order service")


@pytest.mark.parametrize(
    ("port", "authority"), [("MQTTS_PORT", "broker/ca.pem"), ("MQTTS_PORT", None), ("MQTT_PORT", None)]
)
async def test_client_without_a_certificate_is_rejected(
    healthy: Compose, folder: Path, port: str, authority: str | None
) -> None:
    tls = MqttTlsSettings(ca=folder / authority) if authority else MqttTlsSettings()
    async with connected(client_at(healthy, port, tls)) as nobody:
        await until(lambda: nobody.link.state.last_error, what="it is told why")

        assert nobody.link.state.connects == 0


async def test_removed_client_is_rejected(healthy: Compose, tmp_path: Path) -> None:
    """By the commands for a change: the broker gets to see the new files, and may read them."""
    stolen = tmp_path / "wms"
    healthy.shell(f"nena-deploy host add $SITE wms && cp -r $SITE/hosts/wms {stolen}")
    healthy.run("kill", "-s", "HUP", "broker")
    async with connected(client_at(healthy, "MQTTS_PORT", identity_in(stolen))) as host:
        await until(lambda: host.came, what="a new host has its rights without a restart")

    healthy.shell("nena-deploy host remove $SITE wms")
    healthy.run("restart", "broker")
    await healthy.all_healthy(SERVICES)

    async with connected(client_at(healthy, "MQTTS_PORT", identity_in(stolen))) as gone:
        await until(lambda: gone.link.state.last_error, what="it is told why")
        assert gone.link.state.connects == 0


@pytest.mark.parametrize("port", ["REST_PORT", "PANEL_PORT"])
@pytest.mark.usefixtures("healthy")
def test_no_service_answers_plain_http(compose: Compose, port: str) -> None:
    with pytest.raises(httpx.TransportError):
        httpx.get(f"http://127.0.0.1:{compose.ports[port]}/healthz", headers=compose.login, timeout=10.0)


@pytest.mark.usefixtures("healthy")
def test_commands_of_the_panel_reach_the_order_service(compose: Compose) -> None:
    body = {"destinations": [{"locationName": "Packing", "operation": "Load cargo"}]}
    answer = httpx.post(
        f"{compose.url('PANEL_PORT')}/api/v1/control/transportOrders",
        json=body,
        headers=compose.login | {"origin": compose.url("PANEL_PORT")},
        timeout=30.0,
        verify=compose.trust,
    )
    assert answer.is_success, answer.text
    assert compose.order(answer.json()["name"])


async def test_prometheus_reads_both_services_by_https(healthy: Compose) -> None:
    url = f"{healthy.url('PROMETHEUS_PORT')}/api/v1/targets"

    def up() -> set[str]:
        targets = (read(url) or {"data": {"activeTargets": []}})["data"]["activeTargets"]
        return {each["scrapeUrl"] for each in targets if each["health"] == "up"}

    wanted = {"https://order-service:55200/metrics", "https://status-aggregator:8080/metrics"}
    await until(lambda: up() == wanted, timeout=60, what=f"{wanted} are up")


@pytest.mark.parametrize("service", sorted(SERVICES))
def test_containers_are_restricted_as_on_one_machine(compose: Compose, service: str) -> None:
    host = compose.containers()[service]["HostConfig"]

    assert host["ReadonlyRootfs"] is True
    assert host["CapDrop"] == ["ALL"]


async def test_lost_orders_are_restored_from_a_backup(healthy: Compose, tmp_path: Path) -> None:
    """By the commands of docs/operations.md for a store in a volume."""
    before = healthy.create(("Packing", "Load cargo"))
    healthy.follow("operations.md", "order-service copy.db >", tmp_path)
    after = healthy.create(("Packing", "Load cargo"))
    healthy.lose_volume("order-service", "orders")

    healthy.follow("operations.md", "cat > orders.db'", tmp_path)
    healthy.run("up", "--detach")
    await healthy.all_healthy(SERVICES)

    assert healthy.order(before)
    assert healthy.order(after) is None
    assert healthy.order(healthy.create(("Packing", "Load cargo")))
