"""What the container files promise, read from the files: no Docker is needed for these."""

from __future__ import annotations

import json
import re
import ssl
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, HTTPServer
from ipaddress import ip_address
from pathlib import Path, PurePath
from threading import Thread
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]  # its stubs would be one more dependency

from nena_shared.web.settings import HttpSettings
from support.certificates import Authority, Files
from support.compose import names_certified, site_environment
from support.guides import commands
from support.waiting import PATIENCE

ROOT = Path(__file__).parents[2]
COMPOSE: dict[str, Any] = yaml.safe_load((ROOT / "docker-compose.yml").read_text())
SERVICES: dict[str, dict[str, Any]] = COMPOSE["services"]
DOCKERFILES = sorted([*ROOT.glob("services/*/Dockerfile*"), *ROOT.glob("tools/*/Dockerfile*")])
OF_OTHERS = {"broker", "postgres", "prometheus", "alertmanager", "grafana"}


def ids(paths: list[Path]) -> list[str]:
    return [f"{path.parent.name}/{path.name}" for path in paths]


@pytest.mark.parametrize("path", DOCKERFILES, ids=ids(DOCKERFILES))
def test_image_runs_unprivileged_from_locked_packages(path: Path) -> None:
    text = path.read_text()
    last = text[text.rindex("\nFROM ") :]

    assert text.count("\nFROM ") == 2
    assert "\nUSER nena\n" in last
    assert "\nHEALTHCHECK " in last
    assert "pip install" not in last
    installs = re.findall(r"install [^\\\n]*", text)
    packages = [each for each in installs if "requirements/" in each]
    assert len(packages) == 2
    assert all("--require-hashes" in each for each in packages)


@pytest.mark.parametrize("path", DOCKERFILES, ids=ids(DOCKERFILES))
def test_image_is_built_only_from_what_docker_is_given(path: Path) -> None:
    given = re.findall(r"^!(\S+)$", (ROOT / ".dockerignore").read_text(), re.MULTILINE)
    copied = re.findall(r"^COPY (?!--from)(.+) \S+$", path.read_text(), re.MULTILINE)
    for source in " ".join(copied).split():
        assert (ROOT / source).exists()
        assert any(PurePath(source).match(each) or source.startswith(f"{each}/") for each in given), source


class Ready(BaseHTTPRequestHandler):
    """Answers as a service that is ready, or is not."""

    status = HTTPStatus.OK

    def do_GET(self) -> None:
        self.send_response(self.status if self.path == "/readyz" else HTTPStatus.NOT_FOUND)
        self.end_headers()


@contextmanager
def serving(files: Files | None) -> Iterator[int]:
    with HTTPServer(("127.0.0.1", 0), Ready) as server:
        if files:
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(files.certificate, files.key)
            server.socket = context.wrap_socket(server.socket, server_side=True)
        Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        yield server.server_port
        server.shutdown()


@pytest.mark.parametrize("status", [HTTPStatus.OK, HTTPStatus.SERVICE_UNAVAILABLE])
@pytest.mark.parametrize("scheme", ["http", "https"])
@pytest.mark.parametrize("service", ["order_service", "status_aggregator"])
def test_health_check_uses_readiness(
    service: str, scheme: str, status: HTTPStatus, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (ROOT / "services" / service / "Dockerfile").read_text()
    found = re.search(r"^HEALTHCHECK [^\n]*\\\n +CMD (.*)$", text, re.MULTILINE)
    assert found is not None
    _, *command = json.loads(found.group(1))
    files = Authority(tmp_path).sign("service") if scheme == "https" else None
    monkeypatch.setattr(Ready, "status", status)
    with serving(files) as port:
        environment = {"NENA_HTTP__PORT": str(port)}
        environment |= {"NENA_HTTP__TLS_CERTIFICATE": str(files.certificate)} if files else {}
        done = subprocess.run(
            [sys.executable, *command], env=environment, capture_output=True, timeout=PATIENCE, check=False
        )
    assert (done.returncode == 0) == (status == HTTPStatus.OK), done.stderr


@pytest.mark.parametrize("name", SERVICES)
def test_services_are_restricted(name: str) -> None:
    service = SERVICES[name]

    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert all(port.startswith("127.0.0.1:") for port in service.get("ports", []))
    assert name in OF_OTHERS or "cap_add" not in service


def test_site_opens_one_port_and_keeps_the_restrictions() -> None:
    site = yaml.safe_load((ROOT / "docker-compose.site.yml").read_text())["services"]

    assert {key for each in site.values() for key in each} == {
        "environment",
        "healthcheck",
        "ports",
        "volumes",
    }
    assert {name: each["ports"] for name, each in site.items() if "ports" in each} == {
        "broker": ["${MQTTS_ADDRESS:-0.0.0.0}:${MQTTS_PORT:-8883}:8883"]
    }
    assert all(volume.endswith(":ro") for each in site.values() for volume in each["volumes"])


def folders_of_site(name: str) -> dict[str, str]:
    """Return the source of each place that the site's file mounts, by that place."""
    site = yaml.safe_load((ROOT / "docker-compose.site.yml").read_text())["services"]
    return {place: source for source, place, _ in (each.rsplit(":", 2) for each in site[name]["volumes"])}


@pytest.mark.parametrize(("name", "port"), [("order-service", 55200), ("status-aggregator", 8080)])
def test_no_token_crosses_a_sites_containers_unencrypted(name: str, port: int) -> None:
    guide = commands("installation.md", "$SITE --host")
    values, folders = site_environment(name), folders_of_site(name)

    assert set(names_certified(name)) == {name, "127.0.0.1"}
    assert not [value for value in values.values() if "http://" in str(value)]
    assert folders["/etc/nena/https"] == f"${{SITE}}/https/{name}"
    for setting in ("TLS_CERTIFICATE", "TLS_KEY"):
        assert values[f"NENA_HTTP__{setting}"].startswith("/etc/nena/https/")
    assert re.search(r"^chown -R 10001 .*\$SITE/https$", guide, re.MULTILINE), "the services may read it"

    scraped = yaml.safe_load((ROOT / "deploy/containers/prometheus.site.yml").read_text())
    (job,) = [each for each in scraped["scrape_configs"] if each["job_name"] == f"nena-{name}"]
    assert job["scheme"] == "https"
    assert job["static_configs"] == [{"targets": [f"{name}:{port}"]}]
    folder, _, file = f"/etc/prometheus/{job['tls_config']['ca_file']}".rpartition("/")
    assert (folders_of_site("prometheus")[folder], file) == ("${SITE}/broker", "ca.pem")


def test_files_of_nena_deploy_are_mounted_with_their_folders() -> None:
    """A container with a single file keeps reading it after another one has replaced it."""
    site = yaml.safe_load((ROOT / "docker-compose.site.yml").read_text())["services"]
    sources = {source for name in site for source in folders_of_site(name).values()}
    assert {each for each in sources if each.startswith("${SITE") and Path(each).suffix} == {
        "${SITE:?names the folder that nena-deploy has made}/broker/mosquitto.conf"
    }, "written once"


def test_file_contains_no_password() -> None:
    text = (ROOT / "docker-compose.yml").read_text()

    assert set(re.findall(r"PASSWORD: (.*)", text)) == {"${POSTGRES_PASSWORD:-}"}


def test_third_party_images_have_a_version() -> None:
    images = [re.sub(r"\$\{\w+:-(.*)\}", r"\1", SERVICES[name]["image"]) for name in OF_OTHERS]

    assert [each for each in images if not re.fullmatch(r"[\w./-]+:v?\d[\w.-]*", each)] == []


def test_clients_of_published_ports_are_not_trusted_as_proxies() -> None:
    """Requests come from the bridge's address; no proxy stands there that would replace X-Forwarded-For."""
    of_http = {name: value for name, value in COMPOSE["x-http"].items() if name.startswith("NENA_HTTP__")}
    fields = {name.removeprefix("NENA_HTTP__").lower(): value for name, value in of_http.items()}
    http = HttpSettings.model_validate({"port": 0, **fields})

    assert http.reverse_proxy
    for bridge in ("172.17.0.1", "172.18.0.1", "192.168.16.1", "10.0.0.1"):
        assert not [each for each in http.trusted_proxies if ip_address(bridge) in each]


def test_services_are_not_superusers_of_the_database() -> None:
    text, postgres = (ROOT / "docker-compose.yml").read_text(), SERVICES["postgres"]
    users = set(re.findall(r"postgresql(?:\+psycopg)?://(\w+)@postgres/", text))

    assert users == {"nena"}
    assert postgres["environment"]["POSTGRES_USER"] not in users
    assert "./deploy/containers/postgres:/docker-entrypoint-initdb.d:ro" in postgres["volumes"]
