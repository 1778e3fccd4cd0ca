"""A site of nena-deploy with everything over TLS: broker, order service, status aggregator, a robot."""

from __future__ import annotations

import asyncio
import ssl
from collections.abc import AsyncIterator, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import httpx
import pytest

from nena_demo.plants import sample_plant_path
from nena_shared.fleet_api.base import Role
from nena_shared.web.users import User, hash_of, write_users
from support.broker import free_port
from support.certificates import Authority
from support.programs import Program
from support.running_site import AGGREGATOR, ORDER_SERVICE, RunningSite
from support.waiting import PATIENCE, awaited

SERVICES = ("order-service", "status-aggregator")
DESCRIPTIONS = {
    "order-service": ("/openapi.json", "/opentcs/openapi.json"),
    "status-aggregator": ("/api/v1/openapi.json",),
}
FILES = 512
"""Files that a service may have open: so few that one machine could use them up."""
MESSAGES_PER_SECOND, MESSAGES_BURST = 20, 100
"""Of a robot's topic; less than by default, because slow machines cannot send more than the default."""
OPEN = ("/healthz", "/readyz")
"""Paths for which no token is needed, by docs/security.md."""


@dataclass(frozen=True, slots=True)
class Route:
    """An operation that a service describes."""

    service: str
    method: str
    path: str


class TlsSite:
    """Addresses of the services by name; the token of a user is the name of its role."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.stack = ExitStack()
        self.mqtt = RunningSite(folder)
        self.stack.callback(self.mqtt.end)
        self._authority = Authority(folder, "https")
        self.ports = {name: free_port() for name in SERVICES}
        self.programs = {
            "order-service": self._service(
                "order-service",
                ORDER_SERVICE,
                "--plant",
                sample_plant_path(),
                "--store.url",
                f"sqlite:///{folder}/orders.db",
                *("--fleet.messages_per_second", MESSAGES_PER_SECOND),
                *("--fleet.messages_burst", MESSAGES_BURST),
            ),
            "status-aggregator": self._service(
                "status-aggregator",
                AGGREGATOR,
                *("--history.url", f"sqlite:///{folder}/history.db"),
                *("--messages_per_second", MESSAGES_PER_SECOND, "--messages_burst", MESSAGES_BURST),
                *("--order_service.url", self.url("order-service"), "--order_service.ca", self._authority.ca),
            ),
        }

    def url(self, service: str) -> str:
        """Return where a service is."""
        return f"https://127.0.0.1:{self.ports[service]}"

    @cached_property
    def trust(self) -> ssl.SSLContext:
        """What trusts the services' certificates."""
        return ssl.create_default_context(cafile=self._authority.ca)

    def client(self, service: str, role: Role | None = None, **more: object) -> httpx.AsyncClient:
        """Return a client with the token of a role, or without one."""
        headers = {"authorization": f"Bearer {role.name}"} if role else {}
        return httpx.AsyncClient(
            base_url=self.url(service),
            headers=headers,
            verify=self.trust,
            timeout=PATIENCE,
            **more,  # type: ignore[arg-type]
        )

    async def ready(self) -> None:
        """Wait until both services answer."""
        for service in SERVICES:
            await self.answers(service)

    async def answers(self, service: str) -> None:
        """Wait until a service answers; it fails if the program has ended."""

        async def look() -> int:
            program = self.programs[service]
            assert program.process.poll() is None, program.log[-3000:]
            try:
                async with self.client(service) as client:
                    return (await client.get("/healthz")).status_code
            except httpx.TransportError:
                return 0

        await awaited(look, lambda status: status == httpx.codes.OK, what=f"{service} answers", every=0.1)

    async def say(self, service: str, request: bytes, *, source: str = "127.0.0.1") -> bytes:
        """Send bytes that no HTTP client would; return the answer."""
        reader, writer = await asyncio.open_connection(
            "127.0.0.1", self.ports[service], ssl=self.trust, local_addr=(source, 0)
        )
        writer.write(request)
        try:
            return await asyncio.wait_for(reader.read(), PATIENCE)
        finally:
            writer.close()

    async def routes(self, service: str) -> list[Route]:
        """Return all operations that a service describes."""
        found = []
        async with self.client(service, Role.ADMIN) as client:
            for description in DESCRIPTIONS[service]:
                document = (await client.get(description)).raise_for_status().json()
                prefix = (
                    description.removesuffix("/openapi.json") if description.startswith("/opentcs") else ""
                )
                found += [
                    Route(service, method.upper(), prefix + path)
                    for path, operations in document["paths"].items()
                    for method in operations
                ]
        return found

    def _service(self, name: str, identity: object, *arguments: object) -> Program:
        files = self._authority.sign(name)
        own = self.mqtt.folder_of(*identity)  # type: ignore[misc] # a kind and a name
        users = self.folder / "users.toml"
        write_users(
            users, [User(name=each.name, role=each, token_sha256=hash_of(each.name)) for each in Role]
        )
        return self.stack.enter_context(
            Program(
                f"nena-{name}",
                *("--http.port", self.ports[name], "--http.users", users, "--http.burst", 1000),
                *("--http.tls_certificate", files.certificate, "--http.tls_key", files.key),
                *("--mqtt.port", self.mqtt.port, "--mqtt.tls.ca", own / "ca.pem"),
                *("--mqtt.tls.certificate", own / "certificate.pem", "--mqtt.tls.key", own / "key.pem"),
                *arguments,
                log=self.folder / f"{name}.log",
                before=("sh", "-c", f'ulimit -n {FILES} && exec "$@"', "sh"),
            )
        )


@pytest.fixture(scope="module")
def running_services(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TlsSite]:
    site = TlsSite(tmp_path_factory.mktemp("site"))
    with site.stack:
        yield site


@pytest.fixture
async def site(running_services: TlsSite) -> AsyncIterator[TlsSite]:
    """Yield a site whose services are healthy before the test, and still are after it."""
    await running_services.ready()
    yield running_services
    for service, program in running_services.programs.items():
        assert program.process.poll() is None, f"{service} has ended:\n{program.log[-3000:]}"
        await running_services.answers(service)
