"""Plant models for tests: from short descriptions, grids of any size, and openTCS XML of any version."""

from __future__ import annotations

from typing import Any

from nena_shared.plant import Path, PlantModel, Point

GRID_MM = 2000


def point(name: str, x_mm: int = 0, y_mm: int = 0, **more: Any) -> Point:
    return Point(name=name, x_mm=x_mm, y_mm=y_mm, **more)


def path(ends: str, length_mm: int = 1000, **more: Any) -> Path:
    """Return a path from A to B for ``"A B"``; default name: ``A --- B``."""
    source, destination = ends.split()
    more.setdefault("name", f"{source} --- {destination}")
    return Path(source=source, destination=destination, length_mm=length_mm, **more)


def plant(*paths: Path, points: str = "", **more: Any) -> PlantModel:
    """Return a model with these paths, their end points, and further ``points``."""
    ends = [end for each in paths for end in (each.source, each.destination)]
    names = dict.fromkeys([*points.split(), *ends])
    return PlantModel(name="test", points=tuple(point(name) for name in names), paths=paths, **more)


def grid_name(column: int, row: int) -> str:
    return f"P-{column}-{row}"


def grid_plant(columns: int, rows: int) -> PlantModel:
    """Return a grid of points 2 m apart, with paths in both directions between neighbours."""
    points = [
        point(grid_name(column, row), column * GRID_MM, row * GRID_MM)
        for row in range(rows)
        for column in range(columns)
    ]
    rights = [(column, row, column + 1, row) for row in range(rows) for column in range(columns - 1)]
    ups = [(column, row, column, row + 1) for row in range(rows - 1) for column in range(columns)]
    paths = []
    for a, b, c, d in rights + ups:
        paths.append(path(f"{grid_name(a, b)} {grid_name(c, d)}", GRID_MM))
        paths.append(path(f"{grid_name(c, d)} {grid_name(a, b)}", GRID_MM))
    return PlantModel(name=f"grid {columns} x {rows}", points=tuple(points), paths=tuple(paths))


def opentcs_xml(body: str, version: str = "7.0.0", name: str = "test") -> bytes:
    """Wrap the objects of a plant model into a document."""
    return f'<?xml version="1.0"?><model version="{version}" name="{name}">{body}</model>'.encode()
