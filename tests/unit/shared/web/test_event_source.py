from __future__ import annotations

import asyncio

from nena_shared.web.event_source import News, nothing_within
from support.pausing import turn_passes
from support.waiting import PATIENCE


async def test_news_wake_everybody_who_waits() -> None:
    news = News()
    waiting = [asyncio.create_task(nothing_within(news.next, PATIENCE)) for _ in range(3)]
    await turn_passes()

    news.came()

    assert await asyncio.gather(*waiting) == [False] * 3


async def test_who_took_its_place_before_misses_nothing_and_who_comes_behind_waits_anew() -> None:
    news = News()
    before = news.next
    news.came()

    assert not await nothing_within(before, PATIENCE)
    assert await nothing_within(news.next, 0.01)
