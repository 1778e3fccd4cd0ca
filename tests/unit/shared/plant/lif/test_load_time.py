"""A layout of 10,000 nodes is loaded in bounded time, beside a bare parse of the same file."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from time import process_time

from nena_shared.plant.lif import read, write
from support.plants import grid_plant

TARGET_SECONDS = 3.0
TIMES_A_BARE_PARSE = 30
"""What counts on a machine that is slow, or busy with other things; JSON is parsed in C, XML is not."""


def test_ten_thousand_nodes_load_in_time() -> None:
    data = write(grid_plant(100, 100), at=datetime(2026, 11, 20, tzinfo=UTC)).data
    start = process_time()
    json.loads(data)
    bare = process_time() - start
    start = process_time()
    model = read(data, strict=True).model
    seconds = process_time() - start
    assert (len(model.points), len(model.paths)) == (10_000, 39_600)
    assert seconds <= max(TARGET_SECONDS, TIMES_A_BARE_PARSE * bare)
