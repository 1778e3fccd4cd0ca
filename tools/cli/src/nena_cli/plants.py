"""``nena plant``: check, convert and activate plant models."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from dataclasses import replace as replace_fields
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Final, NoReturn

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from nena_cli.options import PLAIN, Format
from nena_cli.output import echo, fail, print_object
from nena_cli.service import Service, of_service
from nena_plant_formats import files, lif, opentcs_xml
from nena_plant_formats import nav2_route as nav2_route_graph
from nena_plant_formats.exchange import JSON_LIMITS, ExportReport
from nena_plant_formats.files import PlantFormat
from nena_plant_formats.lif import LifVersion
from nena_shared.fleet_api.operations.plant import CHANGE_PLANT
from nena_shared.plant import PlantModel, PlantModelError, PlantProblem, Vehicle
from nena_shared.plant import property_keys as keys
from nena_shared.plant.advice import find_advice
from nena_shared.plant.fleet_checks import find_fleet_errors
from nena_shared.plant.track import MM_PER_M, BoundingBox

STANDARD_STREAM = "-"


@dataclass(frozen=True, slots=True)
class Finding:
    """A problem of a plant model file, as an error or a warning."""

    problem: PlantProblem
    is_error: bool


@dataclass(frozen=True, slots=True)
class PlantFile:
    """A file that was read; ``model`` is None if it cannot be read."""

    name: str
    kind: PlantFormat | None
    model: PlantModel | None
    findings: tuple[Finding, ...]

    @property
    def errors(self) -> int:
        """Return the number of errors."""
        return sum(finding.is_error for finding in self.findings)


class Target(StrEnum):
    """Formats to convert to."""

    LIF = "lif"
    """LIF 1.0.0."""
    LIF_2_0 = "lif-2.0"
    OPENTCS = "opentcs"
    NENA = "nena"


def read_plant(name: str, *, strict: bool = False) -> PlantFile:
    """Read a plant model from a file, or from standard input for ``-``.

    Raises:
        OSError: the file cannot be read.
    """
    data = read_bytes(name)
    kind = None
    try:
        kind = files.format_of(data)
        report = files.read(data, strict=strict)
    except PlantModelError as error:
        return PlantFile(name, kind, None, _findings(error.problems, are_errors=True))
    return PlantFile(name, kind, report.model, _findings(report.warnings, are_errors=False))


def encode(
    model: PlantModel, target: Target, *, map_id: str | None = None, vehicle_types: Sequence[str] = ()
) -> ExportReport:
    """Return a plant model in this format; LIF requires values that a plant model may lack.

    Raises:
        PlantModelError: the format cannot represent it.
    """
    match target:
        case Target.NENA:
            return ExportReport(model.to_json().encode() + b"\n", ())
        case Target.OPENTCS:
            return opentcs_xml.write(model)
        case Target.LIF | Target.LIF_2_0:
            version = LifVersion.V1_0 if target is Target.LIF else LifVersion.V2_0
            at = datetime.now(UTC)
            return lif.write(model, version, at=at, map_id=map_id, vehicle_types=vehicle_types)


def write_bytes(data: bytes, name: str, *, replace: bool) -> None:
    """Write a file, or to standard output for ``-``.

    Raises:
        OSError: it cannot be written; FileExistsError if it exists and ``replace`` is false.
    """
    if name == STANDARD_STREAM:
        sys.stdout.buffer.write(data)
        sys.stdout.buffer.flush()
        return
    with Path(name).open("wb" if replace else "xb") as out:
        out.write(data)


def read_bytes(name: str) -> bytes:
    """Read a file, or standard input for ``-``, up to one byte over the size limit."""
    most = JSON_LIMITS.size_bytes + 1
    if name == STANDARD_STREAM:
        return sys.stdin.buffer.read(most)
    with Path(name).open("rb") as file:
        return file.read(most)


def _findings(problems: Iterable[PlantProblem], *, are_errors: bool) -> tuple[Finding, ...]:
    return tuple(Finding(problem, are_errors) for problem in problems)


_COLOURS = {"error": "red", "warning": "yellow"}


def findings_json(file: PlantFile, findings: Iterable[Finding], written: str | None = None) -> str:
    """Return one JSON object with the file, its contents and its findings."""
    return json.dumps(
        {
            "file": file.name,
            "format": file.kind,
            "usable": file.model is not None and not file.errors,
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
    """Return the number of objects of each kind."""
    return {
        "points": len(model.points),
        "paths": len(model.paths),
        "locationTypes": len(model.location_types),
        "locations": len(model.locations),
        "blocks": len(model.blocks),
        "vehicles": len(model.vehicles),
    }


def show_contents(file: PlantFile, console: Console) -> None:
    """Print a table of the numbers of objects in the model."""
    if file.model is None:
        return
    table = Table(title=Text(f"{file.model.name or 'plant model'} ({file.kind})"), title_justify="left")
    for kind in counts(file.model):
        table.add_column(kind, justify="right")
    table.add_row(*map(str, counts(file.model).values()))
    console.print(table)


def show_findings(findings: Iterable[Finding], console: Console) -> None:
    """Print a table of findings. Names and texts are from the file, so markup in them is not interpreted."""
    table = Table("severity", "code", "object", "finding", title="Findings", title_justify="left")
    for column in table.columns:
        column.overflow = "fold"  # a key of a property that is cut could not be found in the file
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


app = typer.Typer(no_args_is_help=True, add_completion=False, rich_markup_mode=PLAIN)

PARKING_SHOWN: Final = 5
FOUND: Final = 1
"""Exit status if the plant model has errors."""


Source = Annotated[
    str, typer.Argument(help="openTCS XML, LIF, Nav2's route graph or NeNa's JSON; - for standard input.")
]
Output = Annotated[str, typer.Option("--output", "-o", help="File to write, or - for standard output.")]
Strict = Annotated[bool, typer.Option("--strict", help="Reject LIF that violates its standard.")]
Replace = Annotated[bool, typer.Option("--replace", help="Overwrite an existing file.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print findings as one JSON object.")]


RobotMap = Annotated[
    Path | None,
    typer.Option("--map", metavar="FILE", help="Robot's map (YAML): check how near to obstacles paths are."),
]
Width = Annotated[float, typer.Option("--robot-width", min=0.05, max=10, help="Width of the robots, m.")]
Clearance = Annotated[float, typer.Option(min=0, max=5, help="Room that stays free on each side, m.")]


@app.command()
def check(
    file: Source,
    *,
    robot_map: RobotMap = None,
    width: Width = 0.6,
    clearance: Clearance = 0.1,
    strict: Strict = False,
    as_json: AsJson = False,
) -> None:
    """Check a plant model; the exit status is 1 if an order service would refuse it."""
    with _errors_reported():
        read = read_plant(file, strict=strict)
    if robot_map and read.model is not None:
        with _map_errors_reported():
            from nena_plant_formats.from_map import clearance as room  # noqa: PLC0415 - an extra
            from nena_plant_formats.from_map.robot_map import read_map  # noqa: PLC0415

            found = room.find_close_paths(read.model, read_map(robot_map), width=width, clearance=clearance)
            read = replace_fields(read, findings=(*_findings(found, are_errors=False), *read.findings))
    if read.model is not None:
        errors = _findings(find_fleet_errors(read.model), are_errors=True)
        advice = _findings(find_advice(read.model), are_errors=False)
        read = replace_fields(read, findings=(*errors, *read.findings, *advice))
    if as_json:
        sys.stdout.write(findings_json(read, read.findings) + "\n")
    else:
        console = Console()
        show_contents(read, console)
        show_findings(read.findings, console)
        echo(f"{read.errors} errors, {len(read.findings) - read.errors} warnings")
    raise typer.Exit(FOUND if read.errors else 0)


@app.command()
def new(
    *,
    robot_map: Annotated[
        Path,
        typer.Option("--map", metavar="FILE", help="YAML file of the robot's map, as map_saver writes it."),
    ],
    output: Output,
    width: Width,
    length: Annotated[
        float, typer.Option("--robot-length", min=0.05, max=10, help="Length of the robots, m.")
    ],
    clearance: Clearance = 0.1,
    spacing: Annotated[float, typer.Option(min=0.5, max=20, help="Distance between points, m.")] = 3.0,
    speed: Annotated[float, typer.Option(min=0.05, max=10, help="Maximum speed on paths, m/s.")] = 1.0,
    robots: Annotated[
        list[str] | None,
        typer.Option("--robot", metavar="MANUFACTURER/SERIAL", help="A robot of the plant; repeatable."),
    ] = None,
    replace: Replace = False,
) -> None:
    """Propose a plant model from a robot's map: points, paths, passing places and parking positions."""
    box = BoundingBox(length_mm=round(length * MM_PER_M), width_mm=round(width * MM_PER_M))
    vehicles = tuple(_vehicle_of(robot, box) for robot in robots or ())
    with _map_errors_reported():
        from nena_plant_formats.from_map.free_space import RobotSize  # noqa: PLC0415 - an extra
        from nena_plant_formats.from_map.proposal import propose_plant  # noqa: PLC0415
        from nena_plant_formats.from_map.robot_map import read_map  # noqa: PLC0415

        size = RobotSize(width, length, clearance)
        made = propose_plant(read_map(robot_map), size, spacing=spacing, speed=speed, vehicles=vehicles)
        write_bytes(made.model.to_json().encode() + b"\n", output, replace=replace)
    for remark in made.remarks:
        echo(f"note: {remark}")
    echo(
        f"{output} written: {made.area:.0f} m² for the middle of a robot; points: {len(made.model.points)}, "
        f"paths: {len(made.model.paths)}, pairs of one-way lanes: {made.one_way_pairs}, "
        f"passing places: {made.passing_places}, parking positions: {len(made.parking)}"
    )
    for point in made.parking[:PARKING_SHOWN]:
        echo(f"{point.name}: x {point.x_m:.2f} m, y {point.y_m:.2f} m")


def _vehicle_of(robot: str, box: BoundingBox) -> Vehicle:
    manufacturer, _, serial = robot.partition("/")
    if not manufacturer or not serial:
        fail(f"--robot {robot!r}: use MANUFACTURER/SERIAL, as in the robot's VDA 5050 topics")
    properties = {keys.VDA5050_MANUFACTURER: manufacturer, keys.VDA5050_SERIAL_NUMBER: serial}
    return Vehicle(name=serial, bounding_box=box, properties=properties)


@app.command("import")
def import_(
    file: Source,
    *,
    output: Output,
    strict: Strict = False,
    replace: Replace = False,
    as_json: AsJson = False,
) -> None:
    """Convert a plant model to NeNa's own JSON without loss."""
    with _errors_reported():
        read = read_plant(file, strict=strict)
        model = read.model or _reject_model(read, as_json=as_json)
        _write(encode(model, Target.NENA), read, output, replace=replace, as_json=as_json)


@app.command("export", hidden=True)
@app.command()
def convert(
    file: Source,
    *,
    target: Annotated[Target | None, typer.Option("--format", help="Format to write; lif is 1.0.0.")] = None,
    nav2_route: Annotated[
        bool, typer.Option("--nav2-route", help="Write a route graph of Nav2 (GeoJSON) instead.")
    ] = False,
    output: Output,
    map_id: Annotated[
        str | None,
        typer.Option("--map", help="LIF: mapId of points without one. Route graph: map to write."),
    ] = None,
    frame: Annotated[str, typer.Option("--frame", help="Route graph: frame of the map.")] = "map",
    vehicle_type: Annotated[
        list[str] | None,
        typer.Option(
            "--vehicle-type", help="LIF: vehicle type that may use all nodes and edges; repeatable."
        ),
    ] = None,
    strict: Strict = False,
    replace: Replace = False,
    as_json: AsJson = False,
) -> None:
    """Convert a plant model to openTCS XML 7.0.0, LIF 1.0.0 or 2.0.0, or a route graph, and list losses."""
    if (target is None) is not nav2_route:
        fail("use either --format or --nav2-route")
    with _errors_reported():
        read = read_plant(file, strict=strict)
        model = read.model or _reject_model(read, as_json=as_json)
        if target is None:
            report = nav2_route_graph.write(model, map_id=map_id, frame=frame)
        else:
            report = encode(model, target, map_id=map_id, vehicle_types=vehicle_type or ())
        _write(report, read, output, replace=replace, as_json=as_json)


@app.command()
@of_service
def put(
    service: Service,
    file: Source,
    *,
    check: Annotated[
        bool, typer.Option("--check", help="Only check whether the model can be activated.")
    ] = False,
) -> None:
    """Activate a plant model at a running order service; status 1 if it lacks objects still in use."""
    with _errors_reported():
        data = read_bytes(file)
    done = service.call(CHANGE_PLANT, content=data, query={"check": check})
    if service.output not in (Format.TABLE, Format.WIDE):
        print_object(service.output, done)
        return
    for warning in done.warnings:
        echo(warning)
    result = "activated" if done.changed else "can be activated"
    echo(f"{done.name}: {done.points} points, {done.paths} paths, {done.vehicles} vehicles; {result}")


def _write(report: ExportReport, read: PlantFile, output: str, *, replace: bool, as_json: bool) -> None:
    write_bytes(report.data, output, replace=replace)
    warnings = _findings(report.warnings, are_errors=False)
    _report_findings(read, (*read.findings, *warnings), as_json=as_json, written=output)


def _reject_model(read: PlantFile, *, as_json: bool) -> NoReturn:
    _report_findings(read, read.findings, as_json=as_json)
    raise typer.Exit(FOUND)


def _report_findings(
    read: PlantFile, findings: tuple[Finding, ...], *, as_json: bool, written: str | None = None
) -> None:
    """Report as text on standard error, or as JSON on standard output unless the model goes there."""
    if as_json:
        out = sys.stderr if written == STANDARD_STREAM else sys.stdout
        out.write(findings_json(read, findings, written) + "\n")
        return
    show_findings(findings, Console(stderr=True))
    echo(f"{written} written" if written else f"nothing written: {read.errors} errors")


@contextmanager
def _map_errors_reported() -> Iterator[None]:
    """Report a missing extra, a bad map or another expected error in one line and exit."""
    try:
        from nena_plant_formats.from_map.robot_map import RobotMapError  # noqa: PLC0415 - an extra
    except ImportError as error:
        fail(f"{error}; install what reads maps: pip install 'nena-cli[maps]'")
    with _errors_reported():
        try:
            yield
        except RobotMapError as error:
            fail(error)


@contextmanager
def _errors_reported() -> Iterator[None]:
    """Report an expected error in one line and exit with status 2."""
    try:
        yield
    except FileExistsError as error:
        fail(f"{error.filename} already exists; --replace overwrites it")
    except (OSError, PlantModelError) as error:
        fail(error)
