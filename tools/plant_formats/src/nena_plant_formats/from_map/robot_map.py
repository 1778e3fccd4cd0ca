"""A robot's map as map_server reads it: a YAML file and an image (PGM, PNG or BMP)."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, isfinite, sin
from pathlib import Path
from typing import Final

import numpy as np
import yaml  # type: ignore[import-untyped]
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

MODES: Final = ("trinary", "scale", "raw")
PIXELS_LIMIT: Final = 64 * 1024 * 1024
"""Maximum number of pixels: a small PNG may exceed the memory."""
OPAQUE: Final = 255
UNKNOWN: Final = 205
"""Grey of cells that map_saver has not seen. map_server calls them free if free_thresh is above 0.196."""


class RobotMapError(ValueError):
    """The map cannot be read; the text says why, and what to do."""


@dataclass(frozen=True, slots=True)
class RobotMap:
    """Which cells of a map are known to be free."""

    name: str
    """Name of the map: that of its YAML file."""
    free: NDArray[np.bool_]
    """One value per cell: the rows from the bottom to the top of the image, as in an OccupancyGrid."""
    resolution: float
    """Side of a cell, m."""
    origin: tuple[float, float, float]
    """Pose of the lower left corner in the map frame: x, y (m) and yaw (rad)."""

    def to_plane(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return places (column, row, in cells) in the map frame (x, y, in m)."""
        x, y, yaw = self.origin
        right, up = (points.T + 0.5) * self.resolution
        return np.stack((x + cos(yaw) * right - sin(yaw) * up, y + sin(yaw) * right + cos(yaw) * up), axis=1)

    def to_cells(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the cells (column, row, with fractions) of places in the map frame (x, y, in m)."""
        x, y, yaw = self.origin
        right, up = (places - (x, y)).T
        turned = np.stack((cos(yaw) * right + sin(yaw) * up, cos(yaw) * up - sin(yaw) * right), axis=1)
        cells: NDArray[np.float64] = turned / self.resolution - 0.5
        return cells


def read_map(path: Path) -> RobotMap:
    """Read a map by its YAML file.

    Raises:
        RobotMapError: the file or its image is no map.
        OSError: one of them cannot be opened.
    """
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise RobotMapError(f"{path.name} is no YAML: {error}") from error
    if not isinstance(values, dict) or not isinstance(values.get("image"), str):
        raise RobotMapError(
            f"{path.name} names no image. Pass the YAML file that map_saver wrote beside the image."
        )
    mode = values.get("mode", "trinary")
    if mode not in MODES:
        raise RobotMapError(f"{path.name}: mode {mode!r} is unknown. Use {', '.join(MODES)}.")
    resolution = _number(path, "resolution", values.get("resolution"))
    if resolution <= 0:
        raise RobotMapError(f"{path.name}: resolution {resolution} must be greater than 0 (m).")
    origin = values.get("origin")
    if not isinstance(origin, list) or len(origin) != len(("x", "y", "yaw")):
        raise RobotMapError(f"{path.name}: origin {origin!r} must be [x, y, yaw].")
    x, y, yaw = (_number(path, "origin", each) for each in origin)
    image = _read_image(path.parent / values["image"])
    free = _free_cells(
        image,
        mode=mode,
        negate=bool(values.get("negate", False)),
        threshold=_number(path, "free_thresh", values.get("free_thresh", 0.25)),
    )
    return RobotMap(path.stem, free[::-1], resolution, (x, y, yaw))


def _number(path: Path, key: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise RobotMapError(f"{path.name}: {key} {value!r} must be a number.")
    return float(value)


def _read_image(path: Path) -> NDArray[np.float64]:
    """Return the image's grey, and its alpha where it has one, from 0 to 255: rows, columns, channels."""
    try:
        with Image.open(path) as image:
            if image.width * image.height > PIXELS_LIMIT:
                raise RobotMapError(
                    f"{path.name} has {image.width} x {image.height} pixels; at most {PIXELS_LIMIT}."
                )
            if image.mode.startswith("I"):  # 16 bits
                return np.asarray(image, dtype=np.float64)[..., None] / 257
            has_alpha = image.has_transparency_data
            return np.asarray(image.convert("RGBA" if has_alpha else "RGB"), dtype=np.float64)
    except (UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise RobotMapError(f"{path.name} is no PGM, PNG or BMP.") from error


def _free_cells(
    image: NDArray[np.float64], *, mode: str, negate: bool, threshold: float
) -> NDArray[np.bool_]:
    """Return the free cells as nav2_map_server's map_io does."""
    # map_io: in trinary mode, alpha counts as a fourth colour; in scale mode, what is not opaque is unknown.
    colours = image if mode == "trinary" else image[..., :3]
    shade = colours.mean(axis=2)
    if mode == "raw":
        below: NDArray[np.bool_] = np.rint(shade) < threshold * 100
        return below
    occupied = (shade if negate else OPAQUE - shade) / OPAQUE
    free: NDArray[np.bool_] = (occupied < threshold) & ((shade != UNKNOWN) | (mode == "scale"))
    if mode == "scale" and image.shape[2] > len("rgb"):
        free &= image[..., 3] == OPAQUE
    return free
