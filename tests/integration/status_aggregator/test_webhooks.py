"""Web hooks of the attention list to real receivers: one that answers, is slow, is dead or answers 500."""

from __future__ import annotations

import asyncio
import base64
import hashlib
import hmac
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from fastapi import FastAPI, Request, Response

from nena_shared.extensions import webhooks
from nena_shared.vda5050.topics import Topic
from nena_shared.web.server import HttpServer
from nena_shared.web.settings import HttpSettings
from nena_status_aggregator.extensions.webhooks import WAITING, AttentionWebhook, AttentionWebhookSettings
from nena_status_aggregator.fleet.model import FleetModel, ModelLimits
from support.broker import Broker, MqttPeer, free_port
from support.clocks import ManualClock
from support.fleet_examples import START, connection, state
from support.matters import ModelSite, emergency, failed
from support.panel import seconds_now
from support.served_aggregator import Served, serving
from support.waiting import PATIENCE, until

pytestmark = pytest.mark.broker

KEY = b"0123456789abcdef0123456789abcdef"


class Receiver:
    """Answers with the statuses of the test, then with 200; None: not before the test ends."""

    def __init__(self, folder: Path, name: str, *answers: int | None, **settings: Any) -> None:
        self.port = free_port()
        secret = folder / "secret"
        secret.write_text("whsec_" + base64.b64encode(KEY).decode())
        url = f"http://127.0.0.1:{self.port}/hook"
        self.settings = {"name": name, "url": url, "secret_file": secret, **settings}
        self.by_id: dict[str, dict[str, Any]] = {}
        self.attempts = 0
        self._answers = list(answers)
        self._ended = asyncio.Event()

    @property
    def bodies(self) -> list[dict[str, Any]]:
        """What has arrived, once each: messages may arrive again."""
        return [*self.by_id.values()]

    @property
    def told(self) -> list[tuple[str, str]]:
        return [(each["type"], each["data"]["id"]) for each in self.bodies]

    @asynccontextmanager
    async def listening(self) -> AsyncIterator[None]:
        """Receive until the block ends; wrongly signed messages fail."""
        app = FastAPI()

        @app.post("/hook")
        async def hook(request: Request) -> Response:
            self.attempts += 1
            body, headers = await request.body(), request.headers
            content = f"{headers['webhook-id']}.{headers['webhook-timestamp']}.".encode() + body
            digest = base64.b64encode(hmac.new(KEY, content, hashlib.sha256).digest()).decode()
            assert headers["webhook-signature"] == f"v1,{digest}"
            answer = self._answers.pop(0) if self._answers else 200
            if answer is None:
                await self._ended.wait()
            elif answer == 200:
                self.by_id[headers["webhook-id"]] = await request.json()
            return Response(status_code=answer or 200)

        server = HttpServer(app, HttpSettings(port=self.port))
        task = asyncio.create_task(server.run())
        yield
        self._ended.set()
        server.stop()
        await asyncio.wait_for(task, PATIENCE)


def report(served: Served, peer: MqttPeer, number: int, **fields: Any) -> None:
    served.send(peer, Topic.CONNECTION, connection(number=number), retain=True)
    served.send(peer, Topic.STATE, state(number, at=seconds_now(), **fields))


async def test_each_change_arrives_once_whatever_other_receivers_do(
    broker: Broker, interface_name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(webhooks, "PAUSES", (0.05,))
    monkeypatch.setattr(webhooks, "ANSWER_SECONDS", 2.0)
    good = Receiver(tmp_path, "good")
    slow = Receiver(tmp_path, "slow", None, None)
    broken = Receiver(tmp_path, "broken", 500, 500, 500)
    dead = Receiver(tmp_path, "dead", retry_hours=1e-5)
    some = Receiver(tmp_path, "some", kinds=("jam",))
    every = [good, slow, broken, dead, some]
    settings = {"webhooks": [each.settings for each in every]}
    async with good.listening(), slow.listening(), broken.listening(), some.listening():
        with MqttPeer(broker) as peer:
            async with serving(broker, interface_name, **settings) as served:
                report(served, peer, 1, **emergency("MANUAL"))
                found = await served.until("/api/v1/attention", lambda found: found["attention"])
                (matter,) = found["attention"]
                address = f"/api/v1/attention/{matter['id']}/acknowledgement"
                await served.http.post(address, json={"by": "Anna"})
                report(served, peer, 2)
                expected = [
                    (f"attention.{what}", matter["id"]) for what in ("began", "acknowledged", "ended")
                ]
                await until(lambda: good.told == slow.told == broken.told == expected, what="all messages")
                await served.metric('nena_webhook_messages_total{result="dropped",webhook="dead"} 3.0')
                await served.metric('nena_webhook_retrying{webhook="dead"} 0.0')
                await served.metric('nena_webhook_messages_total{result="delivered",webhook="slow"} 3.0')
    assert slow.attempts >= 5
    assert broken.attempts >= 6
    assert some.attempts == 0
    assert good.bodies[0]["data"] == matter
    assert good.bodies[1]["data"]["acknowledged"]["by"] == "Anna"


async def test_queue_is_bounded_and_loses_the_oldest(tmp_path: Path) -> None:
    receiver = Receiver(tmp_path, "wms")
    clock = ManualClock(start=START)
    hook = AttentionWebhook(AttentionWebhookSettings.model_validate(receiver.settings), clock)
    site = ModelSite(FleetModel(ModelLimits(orders=2 * WAITING), on_matter=hook.add), clock)
    for number in range(WAITING + 5):
        failed(f"T-{number:04}")(site)
    site.list()
    assert hook.dropped == 5
    (first,) = await hook.read()
    assert first.subject == "order_failed:T-0005"
    hook.note_done(first)
    (second,) = await hook.read()
    assert second.subject == "order_failed:T-0006"
