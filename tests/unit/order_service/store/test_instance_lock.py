from __future__ import annotations

from pathlib import Path

import pytest

from nena_order_service.store.errors import StoreError
from nena_order_service.store.instance_lock import InstanceLock


def test_second_owner_is_refused_until_the_first_lets_go(sqlite_url: str) -> None:
    first = InstanceLock.take(sqlite_url)
    assert first is not None
    with pytest.raises(StoreError, match="another order service"):
        InstanceLock.take(sqlite_url)
    first.release()
    second = InstanceLock.take(sqlite_url)
    assert second is not None
    second.release()


def test_only_files_are_locked() -> None:
    assert InstanceLock.take("postgresql://host/orders") is None


@pytest.mark.parametrize(
    "bad", ["nonsense", "sqlite:////no/such/folder/x.db", "sqlite://", "sqlite:///:memory:"]
)
def test_what_cannot_be_locked_is_said(bad: str, tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=r"store\.url"):
        InstanceLock.take(bad)
    assert list(tmp_path.iterdir()) == []
