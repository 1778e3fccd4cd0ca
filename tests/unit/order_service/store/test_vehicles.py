"""What is known of vehicles is replaced and read again."""

from __future__ import annotations

from functools import partial

from nena_order_service.store.changes import Changes
from nena_order_service.store.database import open_database, read_unfinished, write


def test_the_newest_document_of_each_robot_counts(url: str) -> None:
    engine = open_database(url)
    for place in ("at A", "at B"):
        made, later = Changes(), Changes()
        made.put_vehicle("NeNa/V1", lambda: "nowhere")
        later.put_vehicle("NeNa/V1", partial(str, place))
        later.put_vehicle("NeNa/V2", lambda: "at C")
        made.merge(later)
        assert made
        write(engine, made)
        assert read_unfinished(engine).vehicles == {"NeNa/V1": place, "NeNa/V2": "at C"}
