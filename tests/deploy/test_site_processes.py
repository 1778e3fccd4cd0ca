"""The services of docker-compose.site.yml as processes: the same settings, with the files of nena-deploy."""

from __future__ import annotations

import asyncio
import json
import os
import re
import ssl
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from functools import cached_property
from pathlib import Path

import httpx
import pytest

from nena_demo.plants import sample_plant_path
from nena_deploy.identities import Kind
from support.broker import free_port
from support.compose import ROOT, names_certified, site_environment
from support.programs import Program
from support.running_site import RunningSite
from support.waiting import PATIENCE, awaited

pytestmark = pytest.mark.broker

KINDS = {"order-service": Kind.ORDER_SERVICE, "status-aggregator": Kind.STATUS_AGGREGATOR}


class SiteProcesses:
    """Both services and the broker; the containers' names, folders and ports are those of this machine."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.stack = ExitStack()
        self.broker = RunningSite(folder)
        self.stack.callback(self.broker.end)
        self.ports = {name: free_port() for name in KINDS}
        self.environments = {name: self._environment(name) for name in KINDS}
        for name, environment in self.environments.items():
            self.broker.site.certify_https(KINDS[name], names_certified(name), days=1)
            program = Program(f"nena-{name}", log=folder / f"{name}.log", environment=environment)
            self.stack.enter_context(program)

    @cached_property
    def trust(self) -> ssl.SSLContext:
        return ssl.create_default_context(cafile=self.broker.site.folder / "broker" / "ca.pem")

    @property
    def login(self) -> dict[str, str]:
        token = (self.folder / "access" / "users.toml.token").read_text().strip()
        return {"authorization": f"Bearer {token}"}

    def url(self, name: str, scheme: str = "https") -> str:
        return f"{scheme}://127.0.0.1:{self.ports[name]}"

    async def healthy(self, *names: str) -> None:
        """Wait until the services are ready by the health checks of their images."""

        async def look() -> bool:
            return all([await asyncio.to_thread(self._is_healthy, name) for name in names])

        await awaited(look, bool, what=f"health of {names}", every=0.5)

    def _is_healthy(self, name: str) -> bool:
        """Run the health check of the service's image."""
        text = (ROOT / "services" / name.replace("-", "_") / "Dockerfile").read_text()
        found = re.search(r"^HEALTHCHECK [^\n]*\\\n +CMD (.*)$", text, re.MULTILINE)
        assert found
        _, *command = json.loads(found.group(1))
        done = subprocess.run(
            [sys.executable, *command],
            env=os.environ | self.environments[name],
            capture_output=True,
            timeout=PATIENCE,
            check=False,
        )
        return done.returncode == 0

    def _environment(self, name: str) -> dict[str, str]:
        site, access = self.broker.site.folder, self.folder / "access"
        access.mkdir(exist_ok=True)
        here = {
            "/etc/nena/mqtt/": f"{site}/{name}/",
            "/etc/nena/https/": f"{site}/https/{name}/",
            "/var/lib/nena-access/": f"{access}/",
            "https://order-service:55200": self.url("order-service"),
        }
        found = {}
        for variable, value in site_environment(name).items():
            text = str(value)
            for theirs, ours in here.items():
                text = text.replace(theirs, ours)
            found[variable] = text
        found |= {
            "NENA_HTTP__HOST": "127.0.0.1",
            "NENA_HTTP__PORT": str(self.ports[name]),
            "NENA_MQTT__HOST": "127.0.0.1",
            "NENA_MQTT__PORT": str(self.broker.port),
        }
        if name == "order-service":
            found |= {
                "NENA_PLANT": str(sample_plant_path()),
                "NENA_STORE__URL": f"sqlite:///{self.folder}/orders.db",
            }
        else:
            found["NENA_HISTORY__URL"] = f"sqlite:///{self.folder}/history.db"
        return found


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SiteProcesses]:
    made = SiteProcesses(tmp_path_factory.mktemp("site"))
    with made.stack:
        yield made


@pytest.mark.parametrize("name", KINDS)
async def test_the_images_health_check_follows_https(site: SiteProcesses, name: str) -> None:
    await site.healthy(name)


async def test_a_users_command_reaches_the_order_service_by_https(site: SiteProcesses) -> None:
    await site.healthy(*KINDS)
    order = {"destinations": [{"locationName": "Packing", "operation": "Load cargo"}]}
    panel, headers = site.url("status-aggregator"), site.login
    async with httpx.AsyncClient(verify=site.trust, headers=headers, timeout=PATIENCE) as client:
        answer = await client.post(
            f"{panel}/api/v1/control/transportOrders", json=order, headers={"origin": panel}
        )
        assert answer.is_success, answer.text
        name = answer.json()["name"]
        assert (await client.get(f"{site.url('order-service')}/v1/transportOrders/{name}")).is_success


@pytest.mark.parametrize("name", KINDS)
async def test_plain_http_is_not_answered(site: SiteProcesses, name: str) -> None:
    await site.healthy(name)
    async with httpx.AsyncClient(headers=site.login, timeout=PATIENCE) as client:
        with pytest.raises(httpx.TransportError):
            await client.get(f"{site.url(name, 'http')}/healthz")
