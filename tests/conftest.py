"""Fixtures for all tests."""

from __future__ import annotations

import logging
import subprocess
from collections.abc import Iterator
from typing import TYPE_CHECKING
from uuid import uuid4

import pytest
import structlog
from hypothesis import HealthCheck, settings

from nena_shared.tasks import failure_listeners
from support.broker import MOUNT_POINT, Broker, BrokerAddress, mosquitto
from support.brokers import Nats, RabbitMq
from support.postgres import Postgres
from support.programs import as_from_a_terminal
from support.published import Publications, watched
from support.waiting import PATIENCE

if TYPE_CHECKING:
    from support.oidc_issuer import OidcIssuer

# How long an example takes says something about the machine and its load, not about the code.
settings.register_profile("long", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("nena", settings.get_profile("long"), max_examples=30)
settings.load_profile("nena")  # or the long one, see support.selection

# As programs do: the traceback with all local variables that is structlog's default takes seconds.
structlog.configure(
    processors=[
        *structlog.get_config()["processors"][:-1],
        structlog.dev.ConsoleRenderer(colors=False, exception_formatter=structlog.dev.plain_traceback),
    ]
)

pytest_plugins = ["support.selection"]

MARKED_BY = {
    "broker": "broker",
    "own_broker": "broker",
    "nats": "broker",
    "rabbitmq": "broker",
    "each_broker": "broker",
    "postgres": "postgres",
    "own_postgres": "postgres",
    "postgres_server": "postgres",
}
"""Marks by the fixtures that a test asks for, so that ``make test-unit`` leaves out what needs a server."""


def pytest_configure() -> None:
    """Make programs start as from a terminal, also where the tests were started in another way."""
    as_from_a_terminal()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark tests by the servers that they need."""
    for item in items:
        names = set(getattr(item, "fixturenames", ()))
        call = getattr(item, "callspec", None)
        if call is not None and "postgresql" in call.params.values():
            names.add("postgres")
        for fixture in names & MARKED_BY.keys():
            item.add_marker(MARKED_BY[fixture])


@pytest.fixture(scope="session")
def publications() -> Iterator[Publications]:
    """Yield the check of all messages that this process writes."""
    with watched() as found:
        yield found


@pytest.fixture(autouse=True)
def schemas_kept(publications: Publications) -> Iterator[None]:
    """Fail each test in which a message was written that breaks the official schema of its version."""
    publications.take()
    yield
    assert publications.take() == []


@pytest.fixture(autouse=True)
def no_failures_survived(request: pytest.FixtureRequest) -> Iterator[None]:
    """Fail each test in which a service survives a failure, such as that of a task that restarts."""
    found: list[str] = []

    def note(event: str, error: BaseException) -> None:
        found.append(f"{event}: {error!r}")

    failure_listeners.append(note)
    yield
    failure_listeners.remove(note)
    assert not found or request.node.get_closest_marker("provokes_failures"), found


@pytest.fixture(autouse=True)
def own_logging() -> Iterator[None]:
    """Restore the logging configuration after each test.

    Programs configure logging for their process: in a test, for a stream that is closed when the test has
    ended.
    """
    root = logging.getLogger()
    handlers, level, config = root.handlers[:], root.level, structlog.get_config()
    yield
    root.handlers[:] = handlers
    root.setLevel(level)
    structlog.configure(**config)


@pytest.fixture(scope="session")
def broker() -> Iterator[Broker]:
    """Yield a Mosquitto shared by many tests: use separate topics, see ``interface_name``."""
    broker = Broker()
    yield broker
    broker.close()


@pytest.fixture
def changing_broker() -> Iterator[Broker]:
    """Yield a Mosquitto that delivers messages on other topics than those they were published on."""
    told = subprocess.run([mosquitto(), "-h"], capture_output=True, text=True, timeout=PATIENCE, check=False)
    if "mosquitto version 2.0.11" not in told.stdout:
        pytest.skip("Mosquitto 2.0.11 does so; others do not")
    broker = Broker(more=f"mount_point {MOUNT_POINT}\n")
    yield broker
    broker.close()


@pytest.fixture
def own_broker() -> Iterator[Broker]:
    """Yield a Mosquitto that the test may kill, restart, freeze and thaw."""
    broker = Broker()
    yield broker
    broker.close()


@pytest.fixture(scope="session")
def nats() -> Iterator[Nats]:
    """Yield a NATS server shared by many tests, as ``broker``."""
    with Nats() as server:
        yield server


@pytest.fixture(scope="session")
def rabbitmq() -> Iterator[RabbitMq]:
    """Yield a RabbitMQ shared by many tests, as ``broker``; it needs 10 to 30 s to start."""
    with RabbitMq() as server:
        yield server


@pytest.fixture(params=["broker", "nats", "rabbitmq"], ids=["mosquitto", "nats", "rabbitmq"])
def each_broker(request: pytest.FixtureRequest) -> BrokerAddress:
    """Return a shared broker, one after the other: use separate topics, see ``interface_name``."""
    address: BrokerAddress = request.getfixturevalue(request.param)
    return address


@pytest.fixture(scope="session")
def postgres_server() -> Iterator[Postgres]:
    """Yield a PostgreSQL shared by many tests; it has the content of the previous test, see ``postgres``."""
    made = Postgres()
    yield made
    made.close()


@pytest.fixture
def postgres(postgres_server: Postgres) -> Postgres:
    """Return an empty PostgreSQL."""
    postgres_server.empty()
    return postgres_server


@pytest.fixture
def own_postgres() -> Iterator[Postgres]:
    """Yield a PostgreSQL that the test may stop and start."""
    made = Postgres()
    yield made
    made.close()


@pytest.fixture
def interface_name() -> str:
    """Return a first topic level that no other test uses."""
    return f"test-{uuid4().hex[:12]}"


@pytest.fixture
def domain_id() -> Iterator[int]:
    """Return a ROS domain id that no other test uses at the same time."""
    from support.ros import own_domain_id  # noqa: PLC0415 - loads rclpy, which unit tests do without

    with own_domain_id() as reserved:
        yield reserved


@pytest.fixture
def issuer() -> Iterator[OidcIssuer]:
    """Run an OpenID Connect issuer on loopback in place of Keycloak and the like."""
    from support.oidc_issuer import oidc_issuer  # noqa: PLC0415 - loads what only its tests need

    with oidc_issuer() as made:
        yield made
