"""The extension of docs/extensions.md works when it is installed as its page says."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest

from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.tasks import StartError
from nena_status_aggregator.__main__ import main
from nena_status_aggregator.extension import GROUP, installed
from support.broker import Broker, MqttPeer
from support.extension_packages import chat_room, install, install_example
from support.fleet_examples import order_status
from support.served_aggregator import serving
from support.waiting import PATIENCE

pytestmark = pytest.mark.broker


@pytest.fixture
def packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Yield a folder from which Python imports packages."""
    monkeypatch.syspath_prepend(tmp_path)
    installed.cache_clear()
    yield tmp_path
    installed.cache_clear()
    sys.modules.pop("acme_chat", None)


async def test_the_example_tells_of_a_failed_order(
    broker: Broker, interface_name: str, packages: Path
) -> None:
    install_example(packages, GROUP)
    settings = installed()["chat"].Settings
    async with (
        chat_room() as (url, posted),
        serving(broker, interface_name, chat=settings.model_validate({"url": url})) as served,
    ):
        with MqttPeer(broker) as peer:
            topic = served.fleet.order_status("TO-1")
            failed = order_status(
                version=2, reason="no way", state=TransportOrderState.FAILED, finished=datetime.now(UTC)
            )
            for status in (order_status(), failed):
                peer.publish(topic, status.model_dump_json(by_alias=True), retain=True)
            async with asyncio.timeout(PATIENCE):
                assert await posted.get() == {"text": "TO-1 failed: no way"}


async def test_an_extension_that_fails_does_not_stop_the_others(
    broker: Broker, interface_name: str, packages: Path
) -> None:
    code = """
from nena_status_aggregator.extension import Extension

class Broken(Extension):
    def on_event(self, event):
        raise ValueError
"""
    install(packages, "acme_broken", code, group=GROUP, entry="broken = acme_broken:Broken")
    async with serving(broker, interface_name) as served:
        with MqttPeer(broker) as peer:
            peer.publish(
                served.fleet.order_status("TO-1"), order_status().model_dump_json(by_alias=True), retain=True
            )
            assert await served.until("/api/v1/orders", bool)


@pytest.mark.parametrize(
    ("code", "why"), [("import nothing_of_this_name", "nothing_of_this_name"), ("Chat = int", "is no")]
)
def test_an_extension_that_cannot_be_loaded_ends_the_program_with_the_reason(
    packages: Path, capsys: pytest.CaptureFixture[str], code: str, why: str
) -> None:
    install(packages, "acme_chat", code, group=GROUP, entry="chat = acme_chat:Chat")
    with pytest.raises(StartError, match="chat"):
        installed()
    assert main([]) == 1
    told = capsys.readouterr().err
    assert "'chat' (acme_chat:Chat)" in told
    assert why in told
