from __future__ import annotations

from pathlib import Path

import pytest

from nena_order_service.store.instance_lock import InstanceLock
from nena_order_service.store.schema import StoreError


def test_second_owner_is_refused_until_the_first_releases_the_lock(sqlite_url: str) -> None:
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
def test_a_store_that_cannot_be_locked_is_reported(bad: str, tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=r"store\.url"):
        InstanceLock.take(bad)
    assert list(tmp_path.iterdir()) == []


def test_the_database_itself_is_locked(sqlite_url: str) -> None:
    """A file beside it could be deleted, and a second order service would start."""
    lock = InstanceLock.take(sqlite_url)
    assert lock is not None
    file = Path(sqlite_url.removeprefix("sqlite:///"))
    assert list(file.parent.iterdir()) == [file]
    lock.release()


def test_a_file_that_is_deleted_or_replaced_is_noticed(sqlite_url: str) -> None:
    lock = InstanceLock.take(sqlite_url)
    assert lock is not None
    file = Path(sqlite_url.removeprefix("sqlite:///"))
    assert lock.why_lost() == ""
    kept = file.rename(file.with_suffix(".kept"))
    assert "deleted" in lock.why_lost()
    file.touch()
    assert "replaced" in lock.why_lost()
    kept.rename(file)
    assert lock.why_lost() == ""
    lock.release()


def test_a_file_may_be_named_as_sqlite_names_it(sqlite_url: str) -> None:
    lock = InstanceLock.take(sqlite_url.replace("sqlite:///", "sqlite:///file:") + "?uri=true")
    assert lock is not None
    with pytest.raises(StoreError, match="another order service"):
        InstanceLock.take(sqlite_url)
    lock.release()
