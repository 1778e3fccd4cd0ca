"""The extension of docs/extensions.md works when it is installed as its page says."""

from __future__ import annotations

import asyncio
import json
import re
import sys
from collections.abc import AsyncIterator, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.program import StartError
from nena_status_aggregator.__main__ import main
from nena_status_aggregator.extension import GROUP, installed
from support.broker import Broker, MqttPeer, free_port
from support.fleet_examples import order_status
from support.guides import DOCS
from support.served_aggregator import serving
from support.waiting import PATIENCE

pytestmark = pytest.mark.broker


def install(folder: Path, name: str, code: str, entry: str) -> None:
    """Install a module with an entry point for the aggregator, as pip would."""
    (folder / f"{name}.py").write_text(code, encoding="utf-8")
    information = folder / f"{name}-1.0.dist-info"
    information.mkdir()
    (information / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text(f"[{GROUP}]\n{entry}\n")


@pytest.fixture
def packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Yield a folder from which Python imports packages."""
    monkeypatch.syspath_prepend(tmp_path)
    installed.cache_clear()
    yield tmp_path
    installed.cache_clear()
    sys.modules.pop("acme_chat", None)


def example(language: str) -> str:
    """Return the first block of a language on the page."""
    found = re.search(rf"```{language}\n(.*?)```", (DOCS / "extensions.md").read_text("utf-8"), re.DOTALL)
    assert found
    return found[1]


@pytest.fixture
async def chat() -> AsyncIterator[tuple[str, asyncio.Queue[Any]]]:
    """Yield the URL of a chat room, and what is posted to it."""
    posted: asyncio.Queue[Any] = asyncio.Queue(10)

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = await reader.readuntil(b"\r\n\r\n")
        length = re.search(rb"content-length: (\d+)", head.lower())
        assert length
        posted.put_nowait(json.loads(await reader.readexactly(int(length[1]))))
        writer.write(b"HTTP/1.1 204 No Content\r\nConnection: close\r\n\r\n")
        await writer.drain()
        writer.close()

    port = free_port()
    async with await asyncio.start_server(answer, "127.0.0.1", port):
        yield f"http://127.0.0.1:{port}/", posted


async def test_the_example_tells_of_a_failed_order(
    broker: Broker, interface_name: str, packages: Path, chat: tuple[str, asyncio.Queue[Any]]
) -> None:
    url, posted = chat
    entry = example("toml").splitlines()[-1].replace('"', "")
    install(packages, "acme_chat", example("python"), entry)
    async with serving(
        broker, interface_name, chat=installed()["chat"].Settings.model_validate({"url": url})
    ) as served:
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
    install(packages, "acme_broken", code, "broken = acme_broken:Broken")
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
    install(packages, "acme_chat", code, "chat = acme_chat:Chat")
    with pytest.raises(StartError, match="chat"):
        installed()
    assert main([]) == 1
    told = capsys.readouterr().err
    assert "'chat' (acme_chat:Chat)" in told
    assert why in told
