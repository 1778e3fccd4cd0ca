"""Files of plant models: what is read, what is written, and what is known of them then."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from nena_shared.plant import PlantModel, PlantModelError, Problem, files, lif, opentcs_xml
from nena_shared.plant.files import PlantFormat
from nena_shared.plant.json_text import DEFAULT_LIMITS

STANDARD_STREAM = "-"


@dataclass(frozen=True, slots=True)
class Finding:
    """What was found in a file."""

    problem: Problem
    is_error: bool


@dataclass(frozen=True, slots=True)
class PlantFile:
    """A file that has been read; `model` is None where it cannot be used."""

    name: str
    kind: PlantFormat | None
    model: PlantModel | None
    findings: tuple[Finding, ...]

    @property
    def errors(self) -> int:
        """How many of the findings are errors."""
        return sum(finding.is_error for finding in self.findings)


@dataclass(frozen=True, slots=True)
class LifChoices:
    """What a LIF file needs and a plant model may not say; the defaults are those of the writer."""

    map_id: str | None = None
    vehicle_types: tuple[str, ...] = ()


def read(name: str, *, strict: bool = False) -> PlantFile:
    """Read a file, or standard input if it is called ``-``.

    Raises:
        OSError: the file cannot be read.

    """
    data = content_of(name)
    kind = None
    try:
        kind = files.format_of(data)
        report = files.read(data, strict=strict)
    except PlantModelError as error:
        return PlantFile(name, kind, None, _findings(error.problems, are_errors=True))
    return PlantFile(name, kind, report.model, _findings(report.warnings, are_errors=False))


def content(
    model: PlantModel, kind: PlantFormat, *, at: datetime, choices: LifChoices
) -> tuple[bytes, tuple[Finding, ...]]:
    """Give a plant model as a file of this format, and what the format cannot hold.

    Raises:
        PlantModelError: the format cannot hold it at all.

    """
    match kind:
        case PlantFormat.NENA:
            return model.to_json().encode() + b"\n", ()
        case PlantFormat.OPENTCS:
            report = opentcs_xml.write(model)
        case PlantFormat.LIF:
            report = lif.write(model, at=at, map_id=choices.map_id, vehicle_types=choices.vehicle_types)
    return report.data, _findings(report.warnings, are_errors=False)


def write(data: bytes, name: str, *, replace: bool) -> None:
    """Write a file, or to standard output if it is called ``-``.

    Raises:
        OSError: it cannot be written; FileExistsError if it is there and must not be replaced.

    """
    if name == STANDARD_STREAM:
        sys.stdout.buffer.write(data)
        sys.stdout.buffer.flush()
        return
    with Path(name).open("wb" if replace else "xb") as out:
        out.write(data)


def content_of(name: str) -> bytes:
    """Read no more than is refused anyway."""
    most = DEFAULT_LIMITS.size_bytes + 1
    if name == STANDARD_STREAM:
        return sys.stdin.buffer.read(most)
    with Path(name).open("rb") as file:
        return file.read(most)


def _findings(problems: Iterable[Problem], *, are_errors: bool) -> tuple[Finding, ...]:
    return tuple(Finding(problem, are_errors) for problem in problems)
