from __future__ import annotations

import grp
import os
import ssl
import stat
import subprocess
import sys
import tomllib
from base64 import b64decode, b64encode
from contextlib import suppress
from pathlib import Path

import pytest
from cryptography import x509
from typer.testing import CliRunner, Result

from nena_deploy.commands import app
from nena_shared.fleet_api.base import Role
from nena_shared.mqtt.identity import tls_context
from nena_shared.settings import MqttSettings
from nena_shared.web.users import UsersFile
from support.waiting import PATIENCE


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(each) for each in arguments])


@pytest.fixture
def site(tmp_path: Path) -> Path:
    folder = tmp_path / "site"
    done = run("init", folder, "--host", "broker.example", "--host", "192.0.2.1", "--port", 8884)
    assert done.exit_code == 0, done.stderr
    return folder


def listed(site: Path) -> list[list[str]]:
    return [line.split() for line in run("list", site).stdout.splitlines()[1:]]


def test_a_broker_may_have_a_long_name(tmp_path: Path) -> None:
    name = f"b-{'1' * 36}-1.mq.eu-central-1.example"
    done = run("init", tmp_path / "site", "--host", name)
    assert done.exit_code == 0, done.stderr
    assert f'host = "{name}"' in (tmp_path / "site" / "order-service" / "mqtt.toml").read_text()


def shake_hands(files: Path, name: str) -> None:
    """Connect by TLS as Python 3.13 does; raises SSLError if the server is not trusted under the name."""
    client, server = (
        ssl.create_default_context(cafile=files / "ca.pem"),
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER),
    )
    client.verify_flags |= ssl.VERIFY_X509_STRICT
    server.load_cert_chain(files / "certificate.pem", files / "key.pem")
    up, down = ssl.MemoryBIO(), ssl.MemoryBIO()
    ends = [
        client.wrap_bio(down, up, server_hostname=name),
        server.wrap_bio(up, down, server_side=True),
    ]
    while ends:
        for end in tuple(ends):
            with suppress(ssl.SSLWantReadError):
                end.do_handshake()
                ends.remove(end)


def test_a_service_serves_https_under_the_names_it_was_given(site: Path) -> None:
    done = run("https", site, "order-service", "--host", "order-service", "--host", "192.0.2.2")
    assert done.exit_code == 0, done.stderr
    made = site / "https" / "order-service"
    assert (made / "key.pem").stat().st_mode & 0o077 == 0
    for name in ("order-service", "192.0.2.2"):
        shake_hands(made, name)
    with pytest.raises(ssl.SSLError, match=r"192\.0\.2\.3"):
        shake_hands(made, "192.0.2.3")


def test_a_replaced_https_certificate_is_revoked(site: Path) -> None:
    made = []
    for _ in range(2):
        assert run("https", site, "order-service", "--host", "order-service").exit_code == 0
        certificate = (site / "https" / "order-service" / "certificate.pem").read_bytes()
        made.append(x509.load_pem_x509_certificate(certificate).serial_number)
    revoked = x509.load_pem_x509_crl((site / "broker" / "revoked.pem").read_bytes())
    assert [revoked.get_revoked_certificate_by_serial_number(each) is not None for each in made] == [
        True,
        False,
    ]


def test_invalid_host_name_yields_no_certificate(site: Path) -> None:
    done = run("https", site, "order-service", "--host", "büro.example")
    assert (done.exit_code, done.stderr.count("\n")) == (2, 1)
    assert "--host büro.example" in done.stderr
    assert not (site / "https").exists()


def test_invalid_host_name_creates_no_files(tmp_path: Path) -> None:
    done = run("init", tmp_path / "site", "--host", "büro.example")
    assert (done.exit_code, done.stderr.count("\n")) == (2, 1)
    assert "--host büro.example" in done.stderr
    assert not (tmp_path / "site").exists()


def test_robot_files_are_usable_by_its_agent(site: Path) -> None:
    done = run("robot", "add", site, "ACME", "0001")
    assert done.exit_code == 0, done.stderr
    folder = site / "robots" / "ACME" / "0001"

    text = (folder / "mqtt.toml").read_text().replace("/etc/nena", str(folder))
    settings = MqttSettings.model_validate(tomllib.loads(text)["mqtt"])
    assert (settings.host, settings.port) == ("broker.example", 8884)
    assert tls_context(settings.tls) is not None
    assert ["robot", "ACME/0001"] in [line[:2] for line in listed(site)]


def test_removed_robot_leaves_no_files(site: Path) -> None:
    run("robot", "add", site, "ACME", "0001")
    before = (site / "broker" / "revoked.pem").read_bytes()
    assert run("robot", "remove", site, "ACME", "0001").exit_code == 0

    assert "ACME" not in (site / "broker" / "access.list").read_text()
    assert (site / "broker" / "revoked.pem").read_bytes() != before
    assert not (site / "robots" / "ACME" / "0001").exists()
    again = run("robot", "remove", site, "ACME", "0001")
    assert (again.exit_code, "No robot ACME/0001" in again.stderr) == (2, True)


def test_new_certificate_replaces_the_old_one(site: Path) -> None:
    run("host", "add", site, "wms")
    first = (site / "hosts" / "wms" / "certificate.pem").read_bytes()
    run("host", "add", site, "wms")

    assert (site / "hosts" / "wms" / "certificate.pem").read_bytes() != first
    assert [line[:2] for line in listed(site)].count(["host", "wms"]) == 1
    assert run("host", "remove", site, "wms").exit_code == 0


@pytest.mark.parametrize("content", ["{", "[" * 100_000, f'{{"hosts": {[5] * 10_000}}}', "null"])
def test_damaged_register_is_reported_in_one_line(site: Path, content: str) -> None:
    (site / "site.json").write_text(content)
    done = run("list", site)

    assert (done.exit_code, done.stderr.count("\n")) == (2, 1), done.stderr[:1000]
    assert "is not a nena-deploy site (site.json: " in done.stderr
    assert len(done.stderr) < 1000


def test_unsupported_ca_key_is_reported_in_one_line(site: Path) -> None:
    file, kind = site / "authority" / "ca-key.pem", bytes.fromhex("06072a8648ce3d0201")
    first, *middle, last = file.read_text().splitlines()
    other = b64encode(b64decode("".join(middle)).replace(kind, bytes.fromhex("06072a8648c0fd0201"))).decode()
    file.write_text(f"{first}\n{other}\n{last}\n")
    done = run("list", site)

    assert (done.exit_code, done.stderr.count("\n")) == (2, 1), done.stderr[:1000]
    assert "is not a nena-deploy site (" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("list", "{none}"), "is not a nena-deploy site"),
        (("robot", "add", "{none}", "A", "1"), "Create one with `nena-deploy init`"),
        (("robot", "add", "{site}", "A/B", "1"), "is not valid in a topic"),
        (("host", "remove", "{site}", "wms"), "No host wms"),
        (("init", "{site}", "--host", "x"), "is not empty"),
        (("user", "list", "{none}"), "No such file"),
        (("user", "add", "{none}", "a b", "--role", "viewer"), "Invalid user name"),
        (("user", "remove", "{users}", "bob"), "No user bob"),
    ],
)
def test_failure_is_one_clear_line(
    site: Path, tmp_path: Path, arguments: tuple[str, ...], complaint: str
) -> None:
    users = tmp_path / "users.toml"
    run("user", "add", users, "ann", "--role", "viewer")
    done = run(*(each.format(site=site, none=tmp_path / "none", users=users) for each in arguments))

    assert done.exit_code == 2
    assert complaint in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_users_are_added_and_removed(tmp_path: Path) -> None:
    users = tmp_path / "users.toml"
    first = run("user", "add", users, "ann", "--role", "viewer").stdout.strip()
    token = run("user", "add", users, "ann", "--role", "operator").stdout.strip()
    run("user", "add", users, "bob", "--role", "admin")
    loaded = UsersFile(users)

    assert loaded.user_of(first) is None, "the new token has taken its place"
    ann = loaded.user_of(token)
    assert ann is not None
    assert (ann.name, ann.role) == ("ann", Role.OPERATOR)
    assert run("user", "list", users).stdout == "ann\toperator\nbob\tadmin\n"
    run("user", "remove", users, "ann")
    assert loaded.user_of(token) is None


def test_services_can_read_the_users_file_through_their_group(tmp_path: Path) -> None:
    file, group = tmp_path / "users.toml", grp.getgrgid(os.getgroups()[-1] if os.geteuid() else 65534)
    done = run("user", "add", file, "ann", "--role", "viewer", "--group", group.gr_name)
    assert done.exit_code == 0, done.stderr

    run("user", "add", file, "bob", "--role", "viewer")

    status = file.stat()
    assert (status.st_gid, stat.S_IMODE(status.st_mode)) == (group.gr_gid, 0o640)


def test_unknown_group_is_reported(tmp_path: Path) -> None:
    done = run("user", "add", tmp_path / "users.toml", "ann", "--role", "viewer", "--group", "no-such-group")

    assert done.exit_code == 2
    assert "groupadd --system no-such-group" in done.stderr


def test_many_at_once_lose_no_user(tmp_path: Path) -> None:
    file, names = tmp_path / "users.toml", [f"user-{number}" for number in range(6)]
    command = (sys.executable, "-m", "nena_deploy", "user", "add", file, "--role", "viewer")
    running = [subprocess.Popen([*command, name], stdout=subprocess.DEVNULL) for name in names]
    assert [each.wait(PATIENCE) for each in running] == [0] * len(names)

    assert sorted(line.split("\t")[0] for line in run("user", "list", file).stdout.splitlines()) == names


def test_many_at_once_lose_no_robot(site: Path) -> None:
    command = (sys.executable, "-m", "nena_deploy", "robot", "add", site, "ACME")
    running = [subprocess.Popen([*command, str(number)], stderr=subprocess.DEVNULL) for number in range(4)]
    assert [each.wait(PATIENCE) for each in running] == [0] * 4

    assert {line[1] for line in listed(site)} >= {f"ACME/{number}" for number in range(4)}
