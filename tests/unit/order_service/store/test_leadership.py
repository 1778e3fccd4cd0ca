"""Who has the lead of a shared store, on a real PostgreSQL."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import text

from nena_order_service.store.database import Changes, read_order, write
from nena_order_service.store.leadership import Fence, LeaderLock, begin_epoch
from nena_order_service.store.schema import FencedError, open_database
from support.order_service import dispatchable_order
from support.postgres import Postgres
from support.stores import changes
from support.waiting import until


@pytest.fixture
def locks(postgres: Postgres) -> Iterator[tuple[LeaderLock, LeaderLock]]:
    made = (LeaderLock(postgres.url), LeaderLock(postgres.url))
    yield made
    for lock in made:
        lock.release()


async def test_the_lock_is_held_until_released(locks: tuple[LeaderLock, LeaderLock]) -> None:
    one, other = locks
    assert one.connect()
    assert not one.connect()
    assert one.take()
    assert one.keep()
    assert not other.take()
    one.release()
    assert not one.keep()
    await until(other.take)  # the server notices the end of a connection in its own time


def test_a_connection_that_is_ended_holds_no_lock(
    locks: tuple[LeaderLock, LeaderLock], postgres: Postgres
) -> None:
    one, other = locks
    assert one.take()
    postgres.stop()
    postgres.start()
    assert not one.keep()
    assert other.take()
    assert not one.take()


def test_the_active_services_url_is_known_after_its_takeover(
    locks: tuple[LeaderLock, LeaderLock], postgres: Postgres
) -> None:
    assert locks[1].active_url() == ""
    engine = open_database(postgres.url)
    assert locks[1].active_url() == ""
    Fence.raise_for(engine, "http://one.example")
    assert locks[1].active_url() == "http://one.example"


def test_a_replaced_service_commits_nothing(postgres: Postgres) -> None:
    engine = open_database(postgres.url)
    old = Fence.raise_for(engine, "http://old.example")
    write(engine, changes((dispatchable_order(number=1), None)), old)
    new = Fence.raise_for(engine, "http://new.example")
    assert new.epoch > old.epoch
    assert new.is_up(engine)
    assert not old.is_up(engine)
    with pytest.raises(FencedError, match="Restart it as standby"):
        write(engine, changes((dispatchable_order(number=2), None)), old)
    assert read_order(engine, name="T-1") is not None
    assert read_order(engine, name="T-2") is None


def test_an_epoch_increases_regardless_of_the_clock(
    postgres: Postgres, monkeypatch: pytest.MonkeyPatch
) -> None:
    engine = open_database(postgres.url)
    epochs = []
    for seconds in (2_000_000_000, 2_000_000_000, 1_900_000_000, 2_000_000_100):
        monkeypatch.setattr("time.time", lambda seconds=seconds: seconds)
        epochs.append(Fence.raise_for(engine, "").epoch)

    assert epochs == [2_000_000_000, 2_000_000_001, 2_000_000_002, 2_000_000_100]


def test_an_epoch_rises_over_a_restore_from_a_backup(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, url = tmp_path / "orders.db", f"sqlite:///{tmp_path}/orders.db"
    monkeypatch.setattr("time.time", lambda: 2_000_000_000)
    assert begin_epoch(open_database(url)) == 2_000_000_000
    copy = file.read_bytes()
    monkeypatch.setattr("time.time", lambda: 2_000_000_060)
    last = begin_epoch(open_database(url))
    file.write_bytes(copy)
    monkeypatch.setattr("time.time", lambda: 2_000_000_090)

    assert begin_epoch(open_database(url)) > last


def test_a_read_only_store_does_not_prevent_a_new_epoch(tmp_path: Path) -> None:
    engine = open_database(f"sqlite:///{tmp_path}/orders.db")
    with engine.begin() as connection:
        connection.execute(text("DROP TABLE leadership"))

    assert begin_epoch(engine) > 0


def test_a_takeover_waits_for_the_pending_commit(postgres: Postgres) -> None:
    engine = open_database(postgres.url)
    old = Fence.raise_for(engine, "")
    with engine.begin() as connection:
        assert old.lets_pass(connection)
        with engine.begin() as other:
            other.execute(text("SET LOCAL lock_timeout = '50ms'"))
            with pytest.raises(Exception, match="lock timeout"):
                other.execute(text("UPDATE leadership SET epoch = epoch + 1"))
            other.rollback()


def test_a_commit_with_a_lost_answer_is_not_repeated(postgres: Postgres) -> None:
    engine = open_database(postgres.url)
    fence = Fence.raise_for(engine, "")
    made = changes((dispatchable_order(number=1), None))
    write(engine, made, fence)
    fence.commits -= 1  # as if the connection had ended before the answer came
    write(engine, made, fence)
    write(engine, changes((dispatchable_order(number=2), None)), fence)
    assert read_order(engine, name="T-2") is not None
    write(engine, Changes(), fence)
    assert fence.commits == 3
