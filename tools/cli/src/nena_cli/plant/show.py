"""What was found in a plant model, for people and for scripts."""

from __future__ import annotations

import json
from collections.abc import Iterable

from rich.console import Console
from rich.table import Table
from rich.text import Text

from nena_cli.plant.plant_file import Finding, PlantFile
from nena_shared.plant import PlantModel

_COLOURS = {"error": "red", "warning": "yellow"}


def as_json(file: PlantFile, findings: Iterable[Finding], written: str | None = None) -> str:
    """Give one JSON object with the file, what is in it and what was found."""
    return json.dumps(
        {
            "file": file.name,
            "format": file.kind,
            "usable": file.model is not None,
            "model": None if file.model is None else {"name": file.model.name, **counts(file.model)},
            "findings": [
                {
                    "severity": _severity(finding),
                    "code": finding.problem.code,
                    "kind": finding.problem.kind,
                    "name": finding.problem.name,
                    "text": finding.problem.text,
                }
                for finding in findings
            ],
            **({} if written is None else {"written": written}),
        }
    )


def counts(model: PlantModel) -> dict[str, int]:
    """Give how many objects of each kind there are."""
    return {
        "points": len(model.points),
        "paths": len(model.paths),
        "locationTypes": len(model.location_types),
        "locations": len(model.locations),
        "blocks": len(model.blocks),
        "vehicles": len(model.vehicles),
    }


def show_contents(file: PlantFile, console: Console) -> None:
    """Print a table of what is in the model."""
    if file.model is None:
        return
    table = Table(title=Text(f"{file.model.name or 'plant model'} ({file.kind})"), title_justify="left")
    for kind in counts(file.model):
        table.add_column(kind, justify="right")
    table.add_row(*map(str, counts(file.model).values()))
    console.print(table)


def show_findings(findings: Iterable[Finding], console: Console) -> None:
    """Print a table of what was found; names and texts come from the file, so no markup is read in them."""
    table = Table("severity", "code", "object", "finding", title="Findings", title_justify="left")
    for finding in findings:
        severity, problem = _severity(finding), finding.problem
        where = f"{problem.kind} {problem.name!r}" if problem.name else str(problem.kind)
        table.add_row(
            Text(severity, style=_COLOURS[severity]), Text(problem.code), Text(where), Text(problem.text)
        )
    if table.row_count:
        console.print(table)


def _severity(finding: Finding) -> str:
    return "error" if finding.is_error else "warning"
