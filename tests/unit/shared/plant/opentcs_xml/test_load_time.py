"""A plant of 10,000 points is loaded in bounded time, beside a bare parse of the same file."""

from __future__ import annotations

from time import process_time
from xml.etree.ElementTree import fromstring

from nena_shared.plant.opentcs_xml import read, write
from support.plants import grid_plant

TARGET_SECONDS = 3.0
TIMES_A_BARE_PARSE = 20
"""What counts on a machine that is slow, or busy with other things."""


def test_ten_thousand_points_load_in_time() -> None:
    data = write(grid_plant(100, 100)).data
    start = process_time()
    fromstring(data)  # noqa: S314 - written in the line above
    bare = process_time() - start
    start = process_time()
    model = read(data).model
    seconds = process_time() - start
    assert (len(model.points), len(model.paths)) == (10_000, 39_600)
    assert seconds <= max(TARGET_SECONDS, TIMES_A_BARE_PARSE * bare)
