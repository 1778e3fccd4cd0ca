"""The audit trail in the store, on SQLite and PostgreSQL."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any
from unittest.mock import Mock

import pytest
import sqlalchemy as sa
from sqlalchemy.exc import IntegrityError

from nena_order_service.store import audit, database, schema
from nena_order_service.store.audit import AuditChain, AuditRow, read_expired, read_page
from nena_order_service.store.database import Changes
from nena_order_service.store.schema import open_database
from nena_order_service.store.store import Store
from nena_shared.fleet_api.audit import (
    AuditInterface,
    AuditMark,
    AuditPage,
    AuditQuery,
    AuditResult,
    ChainCheck,
)
from support.order_service import dispatchable_order
from support.waiting import PATIENCE

START = datetime(2026, 1, 1, tzinfo=UTC)
OLDEST_FIRST = AuditQuery(oldest_first=True, limit=1000)


def row(minute: int = 0, **fields: Any) -> AuditRow:
    given: dict[str, Any] = {
        "time": START + timedelta(minutes=minute),
        "user": "ann",
        "interface": AuditInterface.REST,
        "client": "nena",
        "operation": "withdraw",
        "object_kind": "transportOrder",
        "object_name": "T-1",
        "request": str,
        "before": "",
        "after": "",
        "result": AuditResult.DONE,
        "reason": "",
        **fields,
    }
    return AuditRow(**given)


def problems(page: AuditPage) -> list[str]:
    return list(ChainCheck().problems(page))


@pytest.fixture
def engine(url: str) -> Any:
    made = open_database(url)
    yield made
    made.dispose()


def write(engine: sa.Engine, *rows: AuditRow, chain: AuditChain | None = None) -> None:
    database.commit_changes(engine, Changes(audit=list(rows)), chain=chain)


def test_rows_are_chained_over_commits_and_restarts(engine: sa.Engine) -> None:
    chain = AuditChain()
    write(engine, row(), row(1), chain=chain)
    write(engine, row(2), chain=chain)
    write(engine, row(3), chain=AuditChain())
    page = read_page(engine, OLDEST_FIRST)
    assert [each.sequence for each in page.entries] == [1, 2, 3, 4]
    assert problems(page) == []
    assert page.last == AuditMark(sequence=4, hash=page.entries[-1].hash)


def test_all_fields_are_returned_as_written(engine: sa.Engine) -> None:
    full = row(
        user="Änne",
        object_name="O'Hara; --",
        request=lambda: '{"reason":"x"}',
        before='{"state":"ACTIVE"}',
        after='{"state":"FAILED"}',
        result=AuditResult.REFUSED,
        reason="ORDER_ENDED: it has ended",
        time=datetime(2026, 1, 1, 1, 2, 3, 456789, tzinfo=UTC),
    )
    write(engine, full)
    (found,) = read_page(engine, AuditQuery()).entries
    expected = {
        "sequence": 1,
        "timestamp": "2026-01-01T01:02:03.456Z",
        "user": "Änne",
        "interface": "REST",
        "client": "nena",
        "operation": "withdraw",
        "objectKind": "transportOrder",
        "object": "O'Hara; --",
        "request": '{"reason":"x"}',
        "before": '{"state":"ACTIVE"}',
        "after": '{"state":"FAILED"}',
        "result": "REFUSED",
        "reason": "ORDER_ENDED: it has ended",
        "hash": found.hash,
    }
    assert found.model_dump(mode="json", by_alias=True) == expected


def test_texts_that_databases_do_not_accept_are_stored_readably(engine: sa.Engine) -> None:
    long = "x" * 5000
    write(engine, row(user="a\0b", object_name="\ud800", client=long, request=lambda: long, reason="\0"))
    page = read_page(engine, OLDEST_FIRST)
    (found,) = page.entries
    assert (found.user, found.object, found.reason) == ("a\ufffdb", "?", "\ufffd")
    assert (len(found.client), len(found.request)) == (100, 2000)
    assert found.request.endswith("… (5000 characters)")
    assert problems(page) == []
    assert read_page(engine, AuditQuery(user="a\0b")).entries == page.entries


def test_change_and_row_are_committed_together_or_not_at_all(engine: sa.Engine) -> None:
    chain = AuditChain()
    order = dispatchable_order()
    changes = Changes(audit=[row()])
    changes.put_order(order, None)
    database.commit_changes(engine, changes, chain=chain)
    again = Changes(audit=[row(1)])
    again.put_order(order, None)
    with pytest.raises(IntegrityError):
        database.commit_changes(engine, again, chain=chain)
    write(engine, row(2), chain=chain)
    page = read_page(engine, OLDEST_FIRST)
    assert [(each.sequence, each.timestamp.minute) for each in page.entries] == [(1, 0), (2, 2)]
    assert problems(page) == []


COLUMNS = [each.name for each in schema.audit.c if each.name != "sequence"]


@pytest.mark.parametrize("column", COLUMNS)
def test_change_of_any_column_is_found(engine: sa.Engine, column: str) -> None:
    write(engine, row(), row(1), row(2))
    value = {"time": 1, "interface": "MQTT", "result": "FAILED"}.get(column, "other")
    with engine.begin() as connection:
        connection.execute(
            sa.update(schema.audit).where(schema.audit.c.sequence == 2).values({column: value})
        )
    assert problems(read_page(engine, OLDEST_FIRST))[0].startswith("row 2 ")


@pytest.mark.parametrize(
    ("removed", "first"),
    [((1,), "row 1 is missing"), ((2,), "row 2 is missing"), ((3, 4), "rows 3 to 4 are missing")],
)
@pytest.mark.parametrize("restarted", ["restarted", ""])
def test_removed_rows_are_found_also_when_more_are_written(
    engine: sa.Engine, removed: tuple[int, ...], first: str, restarted: str
) -> None:
    chain = AuditChain()
    write(engine, row(), row(1), row(2), row(3), chain=chain)
    with engine.begin() as connection:
        connection.execute(sa.delete(schema.audit).where(schema.audit.c.sequence.in_(removed)))
    assert problems(read_page(engine, OLDEST_FIRST))[0].startswith(first)
    write(engine, row(4), chain=AuditChain() if restarted else chain)
    assert problems(read_page(engine, OLDEST_FIRST))[0].startswith(first)


def test_writing_continues_after_the_document_of_the_last_row_is_gone(engine: sa.Engine) -> None:
    write(engine, row(), row(1))
    with engine.begin() as connection:
        connection.execute(sa.delete(schema.documents))
    write(engine, row(2))
    page = read_page(engine, OLDEST_FIRST)
    assert [each.sequence for each in page.entries] == [1, 2, 3]
    assert problems(page) == []


def delete_expired(engine: sa.Engine, before: datetime) -> AuditMark | None:
    mark = read_expired(engine, before)
    database.commit_changes(engine, Changes(expired_audit=mark))
    return mark


def test_oldest_rows_are_deleted_and_the_rest_stays_verifiable(
    engine: sa.Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(audit, "DELETED_AT_ONCE", 2)
    write(engine, *(row(minute) for minute in (0, 1, 2, 9, 3)))
    limit = START + timedelta(minutes=5)
    marks = [delete_expired(engine, limit), delete_expired(engine, limit), delete_expired(engine, limit)]
    assert [mark and mark.sequence for mark in marks] == [2, 3, None], "an older row after a newer one stays"
    page = read_page(engine, OLDEST_FIRST)
    assert [each.sequence for each in page.entries] == [4, 5]
    assert page.deleted == marks[1]
    assert problems(page) == []

    delete_expired(engine, START + timedelta(days=1))
    assert read_page(engine, OLDEST_FIRST).entries == ()
    assert problems(read_page(engine, OLDEST_FIRST)) == []
    write(engine, row(10))
    assert [each.sequence for each in read_page(engine, OLDEST_FIRST).entries] == [6]
    assert problems(read_page(engine, OLDEST_FIRST)) == []


@pytest.mark.parametrize(
    ("query", "expected"),
    [
        ({}, [5, 4, 3, 2, 1]),
        ({"user": "ben"}, [4, 2]),
        ({"operation": "hold"}, [3]),
        ({"object": "T-2"}, [5, 4]),
        ({"result": "REFUSED"}, [5]),
        ({"user": "ben", "object": "T-2"}, [4]),
        ({"since": START + timedelta(minutes=1), "until": START + timedelta(minutes=3)}, [3, 2]),
        ({"limit": 2}, [5, 4]),
        ({"limit": 2, "after": "4"}, [3, 2]),
        ({"oldest_first": True, "limit": 2}, [1, 2]),
        ({"oldest_first": True, "after": "3"}, [4, 5]),
        ({"user": "'; DROP TABLE audit; --"}, []),
    ],
)
def test_rows_are_found_by_user_operation_object_result_and_time(
    engine: sa.Engine, query: dict[str, Any], expected: list[int]
) -> None:
    write(
        engine,
        row(0),
        row(1, user="ben"),
        row(2, operation="hold"),
        row(3, user="ben", object_name="T-2"),
        row(4, object_name="T-2", result=AuditResult.REFUSED),
    )
    page = read_page(engine, AuditQuery.model_validate(query))
    assert [each.sequence for each in page.entries] == expected
    more = "limit" in query and expected not in ([5], [])
    assert page.next == (str(expected[-1]) if more else None)


async def test_store_continues_the_chain_after_a_restart(make_store: Callable[[], Store]) -> None:
    for minute in (0, 1):
        store, written = make_store(), asyncio.Event()
        writing = asyncio.create_task(store.run())
        store.commit(Changes(audit=[row(minute)]), written.set)
        await written.wait()
        writing.cancel()
        await asyncio.gather(writing, return_exceptions=True)
    page = await store.read_audit_page(OLDEST_FIRST)
    assert [each.sequence for each in page.entries] == [1, 2]
    assert problems(page) == []


def test_request_that_cannot_be_serialised_is_recorded_without_body(engine: sa.Engine) -> None:
    def fail() -> str:
        raise TypeError

    write(engine, row(request=fail))
    assert [each.request for each in read_page(engine, AuditQuery()).entries] == [""]


def test_chain_continues_after_a_commit_whose_answer_was_lost(
    engine: sa.Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The retry finds the commit made, so its rows are not written twice, and the next ones follow them."""
    chain, fence, lose = AuditChain(), Mock(), database._write_changes

    def losing(*arguments: Any) -> None:
        lose(*arguments)
        raise ConnectionError

    changes = Changes(audit=[row(), row(1)])
    fence.lets_pass.return_value = True
    with monkeypatch.context() as patched:
        patched.setattr(database, "_write_changes", losing)
        with pytest.raises(ConnectionError):
            database.commit_changes(engine, changes, fence, chain)
    fence.lets_pass.return_value = False
    database.commit_changes(engine, changes, fence, chain)
    write(engine, row(2), chain=chain)
    page = read_page(engine, OLDEST_FIRST)
    assert [(each.sequence, each.timestamp.minute) for each in page.entries] == [(1, 0), (2, 1), (3, 2)]
    assert problems(page) == []


def test_rows_of_a_commit_that_was_rolled_back_leave_no_gap(
    engine: sa.Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    chain, write_rows = AuditChain(), database._write_audit

    def failing(*arguments: Any) -> None:
        write_rows(*arguments)
        raise ConnectionError

    with monkeypatch.context() as patched:
        patched.setattr(database, "_write_audit", failing)
        with pytest.raises(ConnectionError):
            write(engine, row(), chain=chain)
    write(engine, row(1), chain=chain)
    page = read_page(engine, OLDEST_FIRST)
    assert [(each.sequence, each.timestamp.minute) for each in page.entries] == [(1, 1)]
    assert problems(page) == []


def test_requests_are_serialised_before_the_transaction(engine: sa.Engine) -> None:
    """PostgreSQL ends transactions that are idle for 3 s; the retry would take just as long, forever."""
    transactions: list[sa.Connection] = []
    sa.event.listen(engine, "begin", transactions.append)
    seen: list[int] = []

    def serialise() -> str:
        seen.append(len(transactions))
        return "{}"

    write(engine, row(request=serialise))
    assert (seen, len(transactions)) == ([0], 1)


async def test_slow_query_of_the_trail_holds_up_no_other_query(
    engine: sa.Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Creating an order reads the store; a filter may scan millions of rows."""
    go_on = threading.Event()
    read = audit.read_page

    def slow(*arguments: Any) -> AuditPage:
        assert go_on.wait(2 * PATIENCE)
        return read(*arguments)

    monkeypatch.setattr(audit, "read_page", slow)
    store = Store(engine)
    page = asyncio.create_task(store.read_audit_page(AuditQuery()))
    try:
        assert await asyncio.wait_for(store.read_order(name="T-1"), PATIENCE) is None
        assert not page.done()
    finally:
        go_on.set()
        await page
        store.close()
