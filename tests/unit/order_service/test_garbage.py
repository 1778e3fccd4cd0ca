"""What full garbage collections of the order service leave out."""

from __future__ import annotations

import gc
from weakref import ref

import pytest

from nena_order_service import garbage
from nena_order_service.garbage import GROWTH, short_collections


class Ring:
    def __init__(self) -> None:
        self.me = self


@pytest.fixture
def freezes(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Count the freezes, each as 1."""
    found: list[int] = []
    monkeypatch.setattr(gc, "freeze", lambda: found.append(1))
    monkeypatch.setattr(gc, "get_freeze_count", lambda: 1)
    monkeypatch.setattr(garbage, "LONG", float("inf"))
    return found


def test_objects_of_many_new_robots_are_left_out_of_two_collections(freezes: list[int]) -> None:
    counts, found = (0, GROWTH - 1, GROWTH, GROWTH, 3 * GROWTH, 3 * GROWTH, 3 * GROWTH), []
    robots = iter(counts)
    with short_collections(lambda: next(robots)):
        for _ in counts:
            gc.collect()
            found.append(len(freezes))
    gc.collect()

    assert found == [0, 0, 1, 1, 2, 3, 3]


def test_what_a_long_collection_kept_is_left_out(freezes: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    with short_collections(lambda: 0):
        gc.collect()
        assert not freezes
        monkeypatch.setattr(garbage, "LONG", 0.0)
        gc.collect(1)
        assert not freezes, "only full collections search old objects"
        gc.collect()

    assert len(freezes) == 1


def test_garbage_is_collected_before_the_rest_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(garbage, "LONG", 0.0)
    ring = Ring()
    found = ref(ring)
    del ring
    with short_collections(lambda: 0):
        gc.collect()
        assert found() is None
        ring = Ring()
        kept = ref(ring)
        gc.collect()
        del ring
        gc.collect()
        assert kept() is not None, "its cycle was old when a long collection ended"
    gc.unfreeze()
    gc.collect()
    gc.freeze()
    assert kept() is None


def test_an_old_plant_model_is_collected_although_many_robots_have_come() -> None:
    robots = 0
    with short_collections(lambda: robots):
        old = Ring()
        kept = ref(old)
        gc.freeze()
        del old
        robots = 3 * GROWTH
        gc.unfreeze()
        gc.collect()
        gc.freeze()
    assert kept() is None
