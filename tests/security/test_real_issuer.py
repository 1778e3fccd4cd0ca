"""Sign-in and access tokens with a certified OpenID Connect issuer, oidc-provider, in a separate process.

`make oidc-test` installs it; without it these tests are skipped.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urljoin

import httpx
import pytest

from nena_shared.clock import SystemClock
from nena_shared.web.access import COOKIE
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.api.app import make_app
from nena_status_aggregator.settings import (
    AggregatorHttpSettings,
    AggregatorSettings,
    HistorySettings,
    PanelOidcSettings,
)
from support.broker import Broker, free_port
from support.order_service_fleet import Fleet, running
from support.waiting import PATIENCE

SCRIPT = Path(__file__).parent / "oidc_provider" / "issuer.mjs"
MODULES = Path(os.environ.get("NENA_OIDC_PROVIDER", ""))
PANEL = "http://127.0.0.1:8080/"
SESSION, FLEET = "/api/v1/session", "/api/v1/fleet"
ORDER = {"name": "TO-1", "destinations": [{"locationName": "Storage", "operation": "NOP"}]}
STEPS = 12
"""Pages and redirects of a sign-in."""

pytestmark = [
    pytest.mark.skipif(
        "NENA_OIDC_PROVIDER" not in os.environ, reason="needs the npm package oidc-provider: make oidc-test"
    ),
    pytest.mark.e2e,
]


@dataclass(frozen=True)
class Issuer:
    address: str
    secret: Path

    def settings(self, **more: object) -> PanelOidcSettings:
        return PanelOidcSettings.model_validate(
            {
                "issuer": self.address,
                "audience": "nena",
                "client_id": "nena-panel",
                "client_secret_file": self.secret,
                "panel_url": PANEL,
                **more,
            }
        )


@pytest.fixture(params=["RS256", "ES256"])
def issuer(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Issuer]:
    port = free_port()
    shutil.copy(SCRIPT, MODULES / SCRIPT.name)
    (tmp_path / "secret").write_text("panel-secret")
    (tmp_path / "secret").chmod(0o600)
    command = ["node", str(MODULES / SCRIPT.name), str(port), PANEL, request.param]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline().strip().endswith("ready")
        yield Issuer(f"http://127.0.0.1:{port}", tmp_path / "secret")
        process.kill()


@asynccontextmanager
async def panel_of(issuer: Issuer, **more: object) -> AsyncIterator[httpx.AsyncClient]:
    settings = AggregatorSettings(
        history=HistorySettings(url=None), http=AggregatorHttpSettings(port=0, oidc=issuer.settings(**more))
    )
    app = make_app(Aggregator(settings, SystemClock()), settings.http)
    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url=PANEL) as client:
        yield client


async def at_issuer(start: str, name: str) -> str:
    """Act as the browser of the user ``name``; return the issuer's redirect."""
    async with httpx.AsyncClient(timeout=PATIENCE) as browser:
        answer = await browser.get(start)
        for _ in range(STEPS):
            if location := answer.headers.get("location"):
                place = str(urljoin(str(answer.url), location))
                if place.startswith(PANEL):
                    return place
                answer = await browser.get(place)
                continue
            assert answer.status_code == 200, answer.text
            action = re.search(r'<form[^>]*action="([^"]+)"', answer.text)
            prompt = re.search(r'name="prompt" value="(\w+)"', answer.text)
            assert action, answer.text
            assert prompt, answer.text
            form = {"prompt": prompt[1], "login": name, "password": "any"}
            answer = await browser.post(urljoin(str(answer.url), action[1]), data=form)
    pytest.fail(f"the issuer has not sent the browser back: {answer.text}")


async def signed_in(panel: httpx.AsyncClient, name: str) -> httpx.Response:
    """Return the panel's answer to the issuer's redirect."""
    offer = (await panel.get(f"{SESSION}/oidc")).json()
    sent = await panel.get(offer["start"])
    return await panel.get(await at_issuer(sent.headers["location"], name))


async def test_user_signs_in_to_the_panel(issuer: Issuer) -> None:
    async with panel_of(issuer) as panel:
        assert (await panel.get(FLEET)).status_code == 401
        back = await signed_in(panel, "ann")

        assert back.headers["location"] == PANEL, back.text
        assert (await panel.get(SESSION)).json() == {"user": "ann", "role": "operator"}
        assert (await panel.get(FLEET)).status_code == 200


async def test_user_without_a_role_is_rejected(issuer: Issuer) -> None:
    async with panel_of(issuer) as panel:
        back = await signed_in(panel, "bob")

        assert back.headers["location"].endswith("?problem=role")
        assert (await panel.get(FLEET)).status_code == 401


async def test_code_works_once_and_in_its_browser_only(issuer: Issuer) -> None:
    async with panel_of(issuer) as panel, panel_of(issuer) as thief:
        sent = await panel.get((await panel.get(f"{SESSION}/oidc")).json()["start"])
        back = await at_issuer(sent.headers["location"], "ann")
        await thief.get((await thief.get(f"{SESSION}/oidc")).json()["start"])

        assert "problem=" in (await thief.get(back)).headers["location"]
        assert (await panel.get(back)).headers["location"] == PANEL
        panel.cookies.delete(COOKIE)
        assert "problem=" in (await panel.get(back)).headers["location"]


async def test_order_service_accepts_only_tokens_of_the_issuer(
    issuer: Issuer, broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    async with panel_of(issuer) as panel, panel_of(issuer) as other:
        tokens = {}
        for client, name in ((panel, "ann"), (other, "vic")):
            await signed_in(client, name)
            tokens[name] = client.cookies[COOKIE]
    fleet = Fleet(broker, interface_name, tmp_path)
    http = {"port": free_port(), "oidc": {"issuer": issuer.address, "audience": "nena"}}
    with fleet.stack:
        async with running(fleet.settings(http=http)) as service:
            for name, status in (("vic", 403), ("ann", 201)):
                headers = {"authorization": f"Bearer {tokens[name]}"}
                assert (
                    await service.post("/v1/transportOrders", json=ORDER, headers=headers)
                ).status_code == status
            head, body, signature = tokens["ann"].split(".")
            for forged in (
                f"{head}.{body[:-2]}AA.{signature}",
                f"{head}.{body}.",
                f"{head}.{body}.{signature[::-1]}",
            ):
                headers = {"authorization": f"Bearer {forged}"}
                assert (await service.get("/v1/vehicles", headers=headers)).status_code == 401
        http["oidc"] = {"issuer": issuer.address, "audience": "another-service"}
        http["port"] = free_port()
        async with running(fleet.settings(http=http)) as service:
            headers = {"authorization": f"Bearer {tokens['ann']}"}
            assert (await service.get("/v1/vehicles", headers=headers)).status_code == 401
