"""What an importer and an exporter give back: the result, and what a person should know about it."""

from dataclasses import dataclass

from nena_shared.plant.errors import Problem
from nena_shared.plant.model import PlantModel


@dataclass(frozen=True, slots=True)
class ImportReport:
    """A plant model that can be used, and what its author should know about it."""

    model: PlantModel
    warnings: tuple[Problem, ...]


@dataclass(frozen=True, slots=True)
class ExportReport:
    """A file's content, and what of the model the file's format cannot hold."""

    data: bytes
    warnings: tuple[Problem, ...]
