"""Read plant models, and report each problem in one line."""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Final

from nena_order_service.errors import InvalidPlantError
from nena_plant_formats.exchange import ImportReport
from nena_plant_formats.files import read
from nena_shared.frozen_model import FrozenModel
from nena_shared.log import get_logger
from nena_shared.plant import PlantModel, PlantModelError
from nena_shared.plant.fleet_checks import find_fleet_errors
from nena_shared.settings import ConfigurationError

log = get_logger(__name__)


@dataclass(frozen=True, slots=True)
class PlantFile:
    """A plant model read from a file."""

    model: PlantModel
    digest: str
    """SHA-256 of the file's content."""


PLANT_MODEL: Final = "plantModel"
"""The kind of the plant model's document in the store."""


class StoredPlant(FrozenModel):
    """A plant model that a host has uploaded in place of the file's."""

    file: str
    """SHA-256 of the file that it replaces."""
    model: str


def load_plant(path: Path) -> PlantFile:
    """Read the plant model in ``path``: openTCS XML, LIF (leniently) or NeNa's own JSON.

    Raises:
        ConfigurationError: the file cannot be read or is not a usable plant model; lists all problems.
    """
    try:
        data = path.read_bytes()
        # 0014: no example of the LIF guideline passes LIF's own schema.
        report = read_plant(data, strict=False)
    except OSError as error:
        raise ConfigurationError([f"plant: cannot read {path}: {error.strerror}"]) from error
    except InvalidPlantError as error:
        raise ConfigurationError([f"plant: {path}: {problem}" for problem in error.problems]) from error
    for warning in report.warnings:
        log.warning("plant model", file=str(path), finding=str(warning))
    model = report.model
    log.info("plant model file read", name=model.name, points=len(model.points), vehicles=len(model.vehicles))
    return PlantFile(model, sha256(data).hexdigest())


def read_plant(data: bytes, *, strict: bool) -> ImportReport:
    """Read a plant model and check it for fleets; ``strict`` refuses LIF that violates its standard.

    Raises:
        InvalidPlantError: ``data`` is not a usable plant model; lists all problems.
    """
    try:
        report = read(data, strict=strict)
    except PlantModelError as error:
        raise InvalidPlantError([str(problem) for problem in error.problems]) from error
    if problems := find_fleet_errors(report.model):
        raise InvalidPlantError([str(problem) for problem in problems])
    return report
