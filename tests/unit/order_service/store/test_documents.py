from __future__ import annotations

from nena_order_service.store.changes import Changes
from nena_order_service.store.database import open_database, write
from nena_order_service.store.documents import read_documents


def test_documents_are_put_replaced_and_deleted(url: str) -> None:
    engine = open_database(url)
    for documents in (
        {("a", "one"): "1", ("a", "two"): "2", ("b", "one"): "3"},
        {("a", "one"): "4", ("a", "two"): None},
    ):
        changes = Changes()
        changes.merge(Changes(documents=dict(documents)))
        assert changes
        write(engine, changes)
    assert read_documents(engine, "a") == {"one": "4"}
    assert read_documents(engine, "b") == {"one": "3"}
