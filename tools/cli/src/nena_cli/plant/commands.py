"""``nena plant``: check, import, export."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from enum import StrEnum
from typing import Annotated, Final, NoReturn

import typer
from rich.console import Console

from nena_cli.fleet.service import Service, of_service
from nena_cli.plant import plant_file, show
from nena_cli.plant.plant_file import Finding, LifChoices, PlantFile
from nena_cli.shell import give_up, put_json, say
from nena_shared.fleet_api.plant_model import PlantModelChange
from nena_shared.plant import PlantModel, PlantModelError
from nena_shared.plant.files import PlantFormat

app = typer.Typer(help="Plant models: openTCS XML, LIF and NeNa's own JSON.", no_args_is_help=True)

FOUND: Final = 1
"""Exit status where the plant model has errors."""


class Target(StrEnum):
    """The formats of others that can be written."""

    LIF = "lif"
    OPENTCS = "opentcs"


Source = Annotated[str, typer.Argument(help="openTCS XML, LIF or NeNa's JSON; - for standard input.")]
Output = Annotated[str, typer.Option("--output", "-o", help="File to write, or - for standard output.")]
Strict = Annotated[bool, typer.Option("--strict", help="Refuse LIF that does not keep to its standard.")]
Replace = Annotated[bool, typer.Option("--replace", help="Write over a file that is there.")]
AsJson = Annotated[bool, typer.Option("--json", help="What was found as one JSON object.")]


@app.command()
def check(file: Source, *, strict: Strict = False, as_json: AsJson = False) -> None:
    """Check a plant model; the exit status is 1 if it cannot be used."""
    with _faults_told():
        read = plant_file.read(file, strict=strict)
    if as_json:
        sys.stdout.write(show.as_json(read, read.findings) + "\n")
    else:
        console = Console()
        show.show_contents(read, console)
        show.show_findings(read.findings, console)
        say(f"{read.errors} errors, {len(read.findings) - read.errors} warnings")
    raise typer.Exit(FOUND if read.errors else 0)


@app.command("import")
def import_(
    file: Source,
    *,
    output: Output,
    strict: Strict = False,
    replace: Replace = False,
    as_json: AsJson = False,
) -> None:
    """Turn a plant model into NeNa's own JSON, which loses nothing."""
    with _faults_told():
        read = plant_file.read(file, strict=strict)
        model = read.model or _refused(read, as_json=as_json)
        _write(read, model, PlantFormat.NENA, output, LifChoices(), replace=replace, as_json=as_json)


@app.command()
def export(
    file: Source,
    *,
    target: Annotated[Target, typer.Option("--format", help="Format to write.")],
    output: Output,
    map_id: Annotated[str | None, typer.Option("--map", help="LIF: map of points that name none.")] = None,
    vehicle_type: Annotated[
        list[str] | None,
        typer.Option("--vehicle-type", help="LIF: to whom all is open; may be given several times."),
    ] = None,
    replace: Replace = False,
    as_json: AsJson = False,
) -> None:
    """Turn a plant model into openTCS XML 7.0.0 or LIF 1.0.0, and say what that cannot hold."""
    choices = LifChoices(map_id, tuple(vehicle_type or ()))
    with _faults_told():
        read = plant_file.read(file)
        model = read.model or _refused(read, as_json=as_json)
        _write(read, model, PlantFormat(target), output, choices, replace=replace, as_json=as_json)


@app.command()
@of_service
def put(
    service: Service,
    file: Source,
    *,
    check: Annotated[bool, typer.Option("--check", help="Only tell whether it could be put in use.")] = False,
) -> None:
    """Put a plant model in use at a running order service; status 1 if something is used that it lacks."""
    with _faults_told():
        data = plant_file.content_of(file)
    with service.connected() as connection:
        done = connection.put_content(PlantModelChange, "/v1/plantModel", data, {"check": str(check).lower()})
    if service.as_json:
        put_json(done)
        return
    for each in done.warnings:
        say(each)
    what = "is in use" if done.changed else "could be put in use"
    say(f"{done.name}: {done.points} points, {done.paths} paths, {done.vehicles} vehicles; it {what}")


def _write(
    read: PlantFile,
    model: PlantModel,
    kind: PlantFormat,
    output: str,
    choices: LifChoices,
    *,
    replace: bool,
    as_json: bool,
) -> None:
    data, losses = plant_file.content(model, kind, at=datetime.now(UTC), choices=choices)
    plant_file.write(data, output, replace=replace)
    _report(read, (*read.findings, *losses), as_json=as_json, written=output)


def _refused(read: PlantFile, *, as_json: bool) -> NoReturn:
    _report(read, read.findings, as_json=as_json)
    raise typer.Exit(FOUND)


def _report(
    read: PlantFile, findings: tuple[Finding, ...], *, as_json: bool, written: str | None = None
) -> None:
    """Tell people on standard error; scripts on standard output, unless the file goes there."""
    if as_json:
        out = sys.stderr if written == plant_file.STANDARD_STREAM else sys.stdout
        out.write(show.as_json(read, findings, written) + "\n")
        return
    show.show_findings(findings, Console(stderr=True))
    say(f"{written} written" if written else f"nothing written: {read.errors} errors")


@contextmanager
def _faults_told() -> Iterator[None]:
    """End with one clear line where the work cannot be done."""
    try:
        yield
    except FileExistsError as error:
        give_up(f"{error.filename} is there already; --replace writes over it")
    except (OSError, PlantModelError) as error:
        give_up(error)
