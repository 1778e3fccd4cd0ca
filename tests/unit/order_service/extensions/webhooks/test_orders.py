"""Web hooks: what is sent, in which order, and what happens if the receiver does not answer."""

from __future__ import annotations

import asyncio
import base64
import hashlib
import hmac
import json
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self, cast

import httpx
import pytest

from nena_order_service.errors import StoreNotReadyError
from nena_order_service.extensions.webhooks import Webhooks
from nena_order_service.extensions.webhooks.orders import OrderWebhook, OrderWebhookSettings
from nena_order_service.service import OrderService
from nena_shared.clock import SystemClock
from nena_shared.extensions import webhooks
from nena_shared.extensions.webhooks import HttpReceiver, id_of, read_secret, sign_message
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.fleet_api.webhooks import WebhookState
from nena_shared.settings import ConfigurationError
from nena_shared.tasks import end
from support.order_service import request
from support.waiting import until

KEY = b"0123456789abcdef0123456789abcdef"
SECRET = "whsec_" + base64.b64encode(KEY).decode()
MOMENT = datetime(2026, 1, 1, tzinfo=UTC)


def hook_settings(folder: Path, **fields: Any) -> OrderWebhookSettings:
    (folder / "secret").write_text(SECRET)
    return OrderWebhookSettings.model_validate(
        {"name": "wms", "url": "http://user:pw@host/hook?key=1", "secret_file": folder / "secret", **fields}
    )


class Receiver:
    """Answers with the statuses of the test, then with 200."""

    def __init__(self, *answers: int | Exception) -> None:
        self._answers = list(answers)
        self.ids: list[str] = []
        self.bodies: list[dict[str, Any]] = []

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        pass

    async def send(self, headers: Mapping[str, str], body: bytes) -> int:
        self.ids.append(headers["webhook-id"])
        answer = self._answers.pop(0) if self._answers else 200
        if isinstance(answer, Exception):
            raise answer
        if answer < 300:
            self.bodies.append(json.loads(body))
        return answer

    @property
    def received(self) -> list[tuple[str, str]]:
        return [(each["type"], each["data"]["name"]) for each in self.bodies]


Listen = Callable[..., Any]


@pytest.fixture
def listen(service: OrderService, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Listen:
    """Return a function that runs a web hook until its block ends."""
    monkeypatch.setattr(webhooks, "PAUSES", (0.01,))

    @asynccontextmanager
    async def run(receiver: Receiver, **fields: Any) -> AsyncIterator[OrderWebhook]:
        settings = hook_settings(tmp_path, **fields)
        hook = OrderWebhook(settings, service.store, SystemClock())
        extension = service.extensions["webhooks"]
        assert isinstance(extension, Webhooks)
        extension.hooks.append(hook)
        hook.receiver = cast("HttpReceiver", receiver)
        task = asyncio.create_task(hook.run())
        await until(lambda: hook._stored >= 0)
        yield hook
        await end(task)
        extension.hooks.remove(hook)

    return run


async def create(client: httpx.AsyncClient, name: str) -> None:
    body = request("South 2", name=name).model_dump(mode="json", by_alias=True, exclude_defaults=True)
    (await client.post("/v1/transportOrders", json=body)).raise_for_status()


def test_the_signature_is_the_one_of_the_scheme() -> None:
    headers = sign_message(KEY, "change-7", MOMENT, b'{"a":1}')
    seconds = str(int(MOMENT.timestamp()))
    expected = hmac.new(KEY, f'change-7.{seconds}.{{"a":1}}'.encode(), hashlib.sha256).digest()
    assert headers["webhook-signature"] == "v1," + base64.b64encode(expected).decode()
    assert (headers["webhook-id"], headers["webhook-timestamp"]) == ("change-7", seconds)


@pytest.mark.parametrize("text", ["", "plain", "whsec_???", "whsec_" + base64.b64encode(b"short").decode()])
def test_a_weak_or_unreadable_secret_is_an_error(tmp_path: Path, text: str) -> None:
    settings = hook_settings(tmp_path)
    settings.secret_file.write_text(text)
    with pytest.raises(ConfigurationError, match="secret_file"):
        read_secret(settings)


async def test_changes_arrive_once_and_in_order(listen: Listen, client: httpx.AsyncClient) -> None:
    await create(client, "before")
    receiver = Receiver()
    async with listen(receiver) as hook:
        await create(client, "T-1")
        await create(client, "T-2")
        await until(lambda: len({name for _, name in receiver.received}) == 2)
        assert hook.status.state is WebhookState.DELIVERING
    assert [name for _, name in receiver.received] == sorted(name for _, name in receiver.received)
    assert len(set(receiver.ids)) == len(receiver.ids)
    again = Receiver()
    async with listen(again) as hook:
        await create(client, "T-3")
        await until(lambda: "T-3" in {name for _, name in again.received})
    # the last one may come again: its number may not have been stored when the first hook was ended
    assert {name for _, name in again.received} <= {"T-2", "T-3"}, "a restart continues where it ended"


async def test_what_changed_while_nothing_ran_is_sent_afterwards(
    listen: Listen, client: httpx.AsyncClient
) -> None:
    async with listen(Receiver()):
        pass
    await create(client, "T-1")
    receiver = Receiver()
    async with listen(receiver):
        await until(lambda: bool(receiver.received))
    assert {name for _, name in receiver.received} == {"T-1"}


async def test_a_failed_message_is_repeated_before_later_ones(
    listen: Listen, client: httpx.AsyncClient
) -> None:
    receiver = Receiver(500, ConnectionError("away"), 302)
    async with listen(receiver) as hook:
        await create(client, "T-1")
        await until(lambda: hook.delivered >= 1)
        attempts = hook.status.attempts
        assert [each.result for each in reversed(attempts)][:4] == ["500", "away", "302", "200"]
        assert (hook.status.state, hook.status.reason) == (WebhookState.DELIVERING, "")


async def test_a_message_is_given_up_after_the_time_for_retries(
    listen: Listen, client: httpx.AsyncClient
) -> None:
    receiver = Receiver(500, 500)
    async with listen(receiver, retry_hours=1e-9) as hook:
        await create(client, "T-1")
        await until(lambda: hook.dropped == 1)
        await until(lambda: hook.status.state is WebhookState.DELIVERING)
        await create(client, "T-2")
        await until(lambda: ("transportOrder.DISPATCHABLE", "T-2") in receiver.received)


async def test_a_failing_store_or_message_does_not_end_it(
    listen: Listen, client: httpx.AsyncClient, service: OrderService, monkeypatch: pytest.MonkeyPatch
) -> None:
    read, failures = service.store.read_changes_after, [StoreNotReadyError("away"), ValueError("unreadable")]

    async def changes_after(number: int, limit: int) -> Any:
        if failures:
            raise failures.pop()
        return await read(number, limit)

    monkeypatch.setattr(service.store, "read_changes_after", changes_after)
    receiver = Receiver()
    async with listen(receiver):
        await create(client, "T-1")
        await until(lambda: bool(receiver.received))
    assert not failures


def test_a_message_has_its_id_by_its_content() -> None:
    assert id_of(b"a") == id_of(b"a") != id_of(b"b")


async def test_a_receiver_that_is_gone_is_not_asked_again(listen: Listen, client: httpx.AsyncClient) -> None:
    receiver = Receiver(410)
    async with listen(receiver) as hook:
        await create(client, "T-1")
        await until(lambda: hook.status.state is WebhookState.DISABLED)
        await create(client, "T-2")
        assert receiver.received == []


async def test_only_the_chosen_states_are_sent(listen: Listen, client: httpx.AsyncClient) -> None:
    receiver = Receiver()
    async with listen(receiver, states=(TransportOrderState.FAILED,)):
        await create(client, "T-1")
        await client.post("/v1/transportOrders/T-1/withdrawal", json={})
        await until(lambda: bool(receiver.received))
    assert receiver.received == [("transportOrder.FAILED", "T-1")]


async def test_the_list_hides_what_is_secret_in_a_url(listen: Listen, client: httpx.AsyncClient) -> None:
    async with listen(Receiver()):
        (shown,) = (await client.get("/v1/webhooks")).json()["webhooks"]
        assert shown["url"] == "http://host/hook"
