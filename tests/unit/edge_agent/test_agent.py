from __future__ import annotations

import gc
from weakref import ref

import pytest

from nena_edge_agent.agent import spare_what_is_loaded


class Ring:
    def __init__(self) -> None:
        self.me = self


def test_what_is_loaded_is_spared_and_what_comes_later_is_collected() -> None:
    spare_what_is_loaded()
    assert gc.get_freeze_count() > 0

    ring = Ring()
    later = ref(ring)
    del ring
    spare_what_is_loaded()
    gc.collect()

    assert later() is None


def test_a_thousand_robots_of_one_process_freeze_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Counting what is frozen walks all of it, so it must not happen for each robot either."""
    calls: list[str] = []
    monkeypatch.setattr(gc, "freeze", lambda: calls.append("freeze"))
    monkeypatch.setattr(gc, "get_freeze_count", lambda: calls.append("count"))
    spare_what_is_loaded.cache_clear()

    for _ in range(1000):
        spare_what_is_loaded()

    assert calls == ["freeze"]
