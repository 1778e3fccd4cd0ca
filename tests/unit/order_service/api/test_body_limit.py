from __future__ import annotations

from collections.abc import AsyncIterator

import httpx

from support.problems import problem

ORDERS = "/v1/transportOrders"


async def test_body_that_is_too_long_is_refused(client: httpx.AsyncClient) -> None:
    async def in_pieces() -> AsyncIterator[bytes]:
        for _ in range(100):
            yield b" " * 100

    for content in (b" " * 5000, in_pieces()):
        answer = await client.post(ORDERS, content=content, headers={"content-type": "application/json"})
        assert "4096 bytes" in problem(answer, 413).detail
