"""Extensions of services as installed packages, and the chat room that those of docs/extensions.md tell."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from support.broker import free_port
from support.guides import DOCS


def install(folder: Path, name: str, code: str, *, group: str, entry: str) -> None:
    """Install a module with an entry point of a group, as pip would."""
    (folder / f"{name}.py").write_text(code, encoding="utf-8")
    information = folder / f"{name}-1.0.dist-info"
    information.mkdir()
    (information / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text(f"[{group}]\n{entry}\n")


def install_example(folder: Path, group: str, name: str = "acme_chat") -> None:
    """Install the example that docs/extensions.md has for a service, with the entry point that it names."""
    page = (DOCS / "extensions.md").read_text("utf-8")
    found = re.search(rf'\[project.entry-points."{group}"\]\n(.*?)\n```', page)
    assert found
    entry, codes = (
        found[1].replace('"', ""),
        re.findall(r"```python\n(.*?)```", page[: found.start()], re.DOTALL),
    )
    install(folder, name, codes[-1], group=group, entry=entry)


@asynccontextmanager
async def chat_room() -> AsyncIterator[tuple[str, asyncio.Queue[Any]]]:
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
