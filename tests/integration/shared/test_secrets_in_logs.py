"""No secret is in a program's log, at its most talkative, whether the secret fits or not."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from nena_demo.plants import sample_plant_path
from nena_shared.fleet_api.base import Role
from nena_shared.web.users import User, hash_of, write_users
from support.broker import Broker, free_port
from support.oidc_issuer import AUDIENCE, oidc_issuer
from support.programs import Program
from support.waiting import PATIENCE

pytestmark = pytest.mark.broker

PASSWORD, DATABASE_PASSWORD, TOKEN, WRONG_TOKEN = (f"secret-of-{each}" for each in ("a", "b", "c", "d"))
CLIENT_SECRET = "secret-of-the-panel"
SECRETS = (PASSWORD, DATABASE_PASSWORD, TOKEN, WRONG_TOKEN, hash_of(TOKEN))


@pytest.fixture
def broker() -> Iterator[Broker]:
    made = Broker(users={"nena": PASSWORD})
    yield made
    made.close()


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """Return a folder with each secret in a separate file."""
    away = f"://nena:{DATABASE_PASSWORD}@127.0.0.1:{free_port()}/nena"
    (tmp_path / "password").write_text(PASSWORD + "\n")
    (tmp_path / "store").write_text(f"postgresql{away}\n")
    (tmp_path / "no-store").write_text(f"oracle{away}\n")
    (tmp_path / "history").write_text(f"postgresql+psycopg{away}\n")
    (tmp_path / "file-store").write_text(f"sqlite:///{tmp_path}/orders.db\n")
    write_users(tmp_path / "users", [User(name="ann", role=Role.VIEWER, token_sha256=hash_of(TOKEN))])
    return tmp_path


def arguments(files: Path, broker: Broker) -> list[object]:
    return [
        *("--log.level", "debug", "--mqtt.port", broker.port),
        *("--mqtt.username", "nena", "--mqtt.password_file", files / "password"),
    ]


def assert_silent(program: Program) -> None:
    assert program.log
    assert [secret for secret in SECRETS if secret in program.log] == []


async def test_working_order_service_logs_no_secrets(files: Path, broker: Broker) -> None:
    given = arguments(files, broker)
    given += ["--plant", sample_plant_path(), "--store.url_file", files / "file-store"]
    given += ["--http.port", 0, "--http.users", files / "users"]
    with Program("nena-order-service", *given, log=files / "log") as program:
        url = (await program.logged(r"http listening.* url=(\S+)")).group(1)
        await program.logged("connected")
        async with httpx.AsyncClient(base_url=url, timeout=PATIENCE) as client:
            for token, status in ((TOKEN, 200), (WRONG_TOKEN, 401)):
                headers = {"authorization": f"Bearer {token}"}
                answer = await client.get("/v1/vehicles", headers=headers)
                assert answer.status_code == status
        await program.logged("unknown token")
        assert (files / "orders.db").exists()
        assert_silent(program)


async def test_tokens_of_an_issuer_are_never_logged(files: Path, broker: Broker) -> None:
    (files / "client").write_text(CLIENT_SECRET)
    given = [*arguments(files, broker), "--history.url", "none", "--http.port", 0]
    with oidc_issuer() as issuer:
        oidc = {"issuer": issuer.address, "audience": AUDIENCE, "client_id": "panel"}
        oidc |= {"panel_url": "https://fleet.example/", "client_secret_file": str(files / "client")}
        given += [part for name, value in oidc.items() for part in (f"--http.oidc.{name}", value)]
        with Program("nena-status-aggregator", *given, log=files / "log") as program:
            url = (await program.logged(r"http listening.* url=(\S+)")).group(1)
            good, ended = issuer.token("vic"), issuer.token("vic", exp=1)
            async with httpx.AsyncClient(base_url=url, timeout=PATIENCE) as client:
                for token, status in ((good, 200), (ended, 401)):
                    headers = {"authorization": f"Bearer {token}"}
                    assert (await client.get("/api/v1/fleet", headers=headers)).status_code == status
            await program.logged("it has expired")
            assert_silent(program)
            assert [each for each in (good, ended, CLIENT_SECRET) if each in program.log] == []


@pytest.mark.parametrize(
    ("script", "more"),
    [
        ("nena-order-service", ("--store.url_file", "store")),
        ("nena-status-aggregator", ("--history.url_file", "history")),
    ],
)
async def test_missing_database_is_logged_without_its_password(
    files: Path, broker: Broker, script: str, more: tuple[str, str]
) -> None:
    given = [*arguments(files, broker), more[0], files / more[1], "--http.port", 0]
    given += ["--plant", sample_plant_path()] if script == "nena-order-service" else []
    with Program(script, *given, log=files / "log") as program:
        await program.logged("(?i)connection refused")
        assert_silent(program)


@pytest.mark.parametrize(
    ("script", "more", "complaint"),
    [
        ("nena-order-service", ("--store.url_file", "no-store"), "oracle is not supported"),
        ("nena-order-service", ("--store.url_file", "missing"), r"store.url_file: .*No such file"),
        ("nena-status-aggregator", ("--history.url_file", "no-store"), "history.url is unusable"),
    ],
)
async def test_unusable_secret_is_reported_without_its_value(
    files: Path, broker: Broker, script: str, more: tuple[str, str], complaint: str
) -> None:
    given = [*arguments(files, broker), more[0], files / more[1], "--http.port", 0]
    given += ["--plant", sample_plant_path()] if script == "nena-order-service" else []
    with Program(script, *given, log=files / "log") as program:
        assert program.process.wait(PATIENCE) != 0
        assert re.search(complaint, program.log)
        assert_silent(program)


async def test_edge_agent_logs_no_secrets(files: Path, broker: Broker) -> None:
    given = [*arguments(files, broker), "--driver", "loopback", "--journal.folder", files / "journal"]
    with Program("nena-edge-agent", *given, log=files / "log") as program:
        await program.logged("connected")
        assert_silent(program)
