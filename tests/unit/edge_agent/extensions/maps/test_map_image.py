from __future__ import annotations

import struct
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_edge_agent.extensions.maps.map_image import OccupancyImage, occupancy_image


def chunks(png: bytes) -> dict[bytes, bytes]:
    """Split a PNG image into chunks; each must have its right checksum."""
    assert png.startswith(b"\x89PNG\r\n\x1a\n")
    found, at = {}, 8
    while at < len(png):
        (length,) = struct.unpack_from(">I", png, at)
        kind, content = png[at + 4 : at + 8], png[at + 8 : at + 8 + length]
        assert struct.unpack_from(">I", png, at + 8 + length) == (zlib.crc32(kind + content),)
        found[kind] = content
        at += length + 12
    return found


def opacities(image: OccupancyImage) -> list[list[int]]:
    """Return the opacity of each pixel, the topmost row first."""
    parts = chunks(image.png)
    width, height, depth, colour = struct.unpack_from(">IIBB", parts[b"IHDR"])
    assert (depth, colour, parts[b"IEND"]) == (8, 3, b"")
    lines = zlib.decompress(parts[b"IDAT"])
    assert len(lines) == height * (width + 1)
    rows = [lines[at : at + width + 1] for at in range(0, len(lines), width + 1)]
    assert all(row[0] == 0 for row in rows)
    return [[parts[b"tRNS"][value] for value in row[1:]] for row in rows]


def test_occupied_cells_are_opaque_and_the_first_row_is_the_lowest() -> None:
    cells = bytes([0, 50, 100, 255, 0, 0])
    assert opacities(occupancy_image(cells, 3, 2, side_limit=10)) == [[40, 0, 0], [0, 128, 255]]


def test_several_cells_make_a_pixel_of_the_surest_of_them() -> None:
    cells = bytes([0, 0, 255, 255, 255, 0, 100, 255, 0, 0, 255, 255, 255, 255, 255])
    image = occupancy_image(cells, 5, 3, side_limit=3)
    assert image.cells_per_pixel == 2
    assert opacities(image) == [[40, 40, 40], [255, 0, 0]]


@given(
    data=st.data(),
    width=st.integers(1, 30),
    height=st.integers(1, 30),
    side_limit=st.integers(1, 30),
)
def test_no_wall_is_lost_and_no_side_is_too_long(
    data: st.DataObject, width: int, height: int, side_limit: int
) -> None:
    cells = bytes(
        data.draw(st.lists(st.sampled_from([0, 100, 255]), min_size=width * height, max_size=width * height))
    )
    image = occupancy_image(cells, width, height, side_limit=side_limit)
    rows = opacities(image)
    factor = image.cells_per_pixel
    assert max(len(rows), len(rows[0])) <= side_limit
    for at, cell in enumerate(cells):
        row, column = divmod(at, width)
        seen = rows[len(rows) - 1 - row // factor][column // factor]
        assert seen == 255 if cell == 100 else seen in (0, 40, 255)


@pytest.mark.parametrize(("cells", "width", "height"), [(b"", 0, 0), (b"123", 2, 2), (b"1234", 4, 0)])
def test_an_invalid_grid_is_refused(cells: bytes, width: int, height: int) -> None:
    with pytest.raises(ValueError, match="do not make a grid"):
        occupancy_image(cells, width, height, side_limit=10)
