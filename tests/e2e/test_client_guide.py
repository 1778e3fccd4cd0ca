"""The page of the Python client: its code runs against a real order service with a loopback robot."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from support.broker import Broker
from support.guides import DOCS
from support.order_service_fleet import Fleet, listening, running

pytestmark = [pytest.mark.e2e, pytest.mark.broker]


@pytest.fixture
async def url(broker: Broker, interface_name: str, tmp_path: Path) -> AsyncIterator[str]:
    """Yield the URL of an order service whose robot is ready."""
    fleet = Fleet(broker, interface_name, tmp_path)
    with fleet.stack:
        async with running(fleet.settings()) as client:
            await listening(client)
            fleet.agent()
            yield str(client.base_url)


def programs(url: str) -> list[str]:
    text = (DOCS / "client.md").read_text(encoding="utf-8")
    found = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    return [each.replace("http://localhost:55200", url) for each in found]


async def test_the_programs_of_the_page_do_what_it_says(url: str, capsys: pytest.CaptureFixture[str]) -> None:
    move, show = programs(url)
    await asyncio.to_thread(exec, compile(move, "move", "exec"), {"__name__": "__main__"})
    assert "WMS-042 FINISHED with Robot-01" in capsys.readouterr().out
    await asyncio.to_thread(exec, compile(show, "show", "exec"), {})
    assert "Robot-01" in capsys.readouterr().out
