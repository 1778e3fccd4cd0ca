"""``nena simulate``: predict the throughput of fleets of several sizes in a plant."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import Annotated
from urllib.parse import quote

import typer

from nena_plant_formats.files import read
from nena_shared.plant import PlantModel
from nena_shared.plant.errors import PlantModelError
from nena_shared.settings import parse_toml
from nena_simulate.demand import Demand, read_orders
from nena_simulate.heat_map import heat_map
from nena_simulate.report import Figures, Report
from nena_simulate.site import Case, Disturbances
from nena_simulate.sweep import executor_for, simulate_all
from nena_simulate.virtual_time import SimulationFailedError

PROGRAM = "nena-simulate"
app = typer.Typer(add_completion=False, rich_markup_mode=None)  # plain help, as that of nena


def _print_version(wanted: bool) -> None:  # noqa: FBT001 - the callback of an option
    if wanted:
        typer.echo(f"{PROGRAM} {version(PROGRAM)}")
        raise typer.Exit


def _parse_numbers(text: str, what: str) -> list[int]:
    """Return the numbers of a list such as 6,8,10 or 1-20."""
    try:
        ends = [each.split("-") for each in text.split(",")]
        numbers = [
            number for first, *last in ends for number in range(int(first), int((last or [first])[0]) + 1)
        ]
    except ValueError:
        numbers = []
    if not numbers or min(numbers) < 1:
        message = f"'{text}' is not a list of {what}; use 6,8,10 or 6-10"
        raise typer.BadParameter(message)
    return list(dict.fromkeys(numbers))


def _draw_pictures(folder: Path, plants: Mapping[str, PlantModel], figures: Iterable[Figures]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for figure in figures:
        title = f"{figure.plant}, {figure.robots} robots"
        picture = heat_map(plants[figure.plant], figure.waiting_by_place, title)
        of_plant = f"{quote(figure.plant, safe=' ')}-" if len(plants) > 1 else ""
        (folder / f"waiting-{of_plant}{figure.robots}.svg").write_text(picture, encoding="utf-8")


def _read_plants(files: Iterable[Path]) -> dict[str, PlantModel]:
    """Return the plants by name. Raises PlantModelError, and ValueError if two have one name."""
    plants: dict[str, PlantModel] = {}
    for file in files:
        model = read(file.read_bytes()).model
        if model.name in plants:
            message = f"{file}: another file already has a plant named {model.name!r}; rename one of them"
            raise ValueError(message)
        plants[model.name] = model
    return plants


PlantFiles = Annotated[
    list[Path],
    typer.Argument(
        help="Plant models to compare: openTCS XML, LIF or NeNa JSON.", exists=True, dir_okay=False
    ),
]
FleetSizes = Annotated[str, typer.Option(help="Fleet sizes: 6,8,10 or 6-10.")]
Hours = Annotated[float, typer.Option(help="Simulated hours.", min=0.01)]
OrderFile = Annotated[
    Path | None,
    typer.Option(help="CSV with from,to,per_hour or at,from,to; or JSON (docs/simulate.md).", exists=True),
]
Backlog = Annotated[
    int,
    typer.Option(help="Number of orders kept waiting at all times, drawn by the relations' rates.", min=0),
]
Seeds = Annotated[
    str,
    typer.Option(
        "--seeds",
        "--seed",
        help="Random seeds, 7 or 1-20. One gives the same result each time, several confidence intervals.",
    ),
]
Speed = Annotated[float, typer.Option(help="Speed of the robots, m/s.", min=0.01)]
Work = Annotated[float, typer.Option(help="Time to pick or drop, seconds.", min=0)]
WarmUp = Annotated[float, typer.Option(help="Minutes of warm-up, excluded from the report.", min=0)]
SettingsFile = Annotated[Path | None, typer.Option(help="Settings of the order service (TOML).", exists=True)]
Spread = Annotated[
    float, typer.Option(help="Random deviation of robots' speeds: 0.3 is 30 %.", min=0, max=0.9)
]
Loss = Annotated[float, typer.Option(help="Share of messages that are lost.", min=0, max=0.5)]
JsonFile = Annotated[Path | None, typer.Option(help="File for the report as JSON.")]
MarkdownFile = Annotated[Path | None, typer.Option(help="File for the tables as Markdown.")]
PictureFolder = Annotated[Path | None, typer.Option(help="Folder for a heat map (SVG) per fleet size.")]
ShowVersion = Annotated[
    bool,
    typer.Option(
        "--version", "-V", callback=_print_version, is_eager=True, help="Show the version and exit."
    ),
]
Jobs = Annotated[int, typer.Option(help="Simulations in parallel on this machine.", min=1)]
Scheduler = Annotated[
    str | None,
    typer.Option(help="Scheduler of a Dask cluster that simulates instead of this machine: tcp://host:8786."),
]
Parts = Annotated[
    int, typer.Option(help="Parts into which the hours are split, each with its own seed and warm-up.", min=1)
]


@app.command()
def simulate(
    plants: PlantFiles,
    *,
    robots: FleetSizes = "5",
    hours: Hours = 1.0,
    orders: OrderFile = None,
    backlog: Backlog = 0,
    seeds: Seeds = "1",
    speed: Speed = 1.0,
    work: Work = 5.0,
    warm_up: WarmUp = 5.0,
    settings: SettingsFile = None,
    speed_spread: Spread = 0.0,
    loss: Loss = 0.0,
    json: JsonFile = None,
    markdown: MarkdownFile = None,
    heat_maps: PictureFolder = None,
    jobs: Jobs = 2,
    on: Scheduler = None,
    parts: Parts = 1,
    version: ShowVersion = False,  # noqa: ARG001 - its callback has printed it
) -> None:
    """Simulate a plant with the real order service and robots that only exist here, in accelerated time."""
    begun = perf_counter()
    sizes, numbers = _parse_numbers(robots, "fleet sizes"), _parse_numbers(seeds, "seeds")
    try:
        models = _read_plants(plants)
        cases = []
        for model in models.values():
            case = Case(
                plant=model,
                demand=Demand(backlog=max(sizes)),
                robots=sizes[0],
                hours=hours,
                seed=numbers[0],
                warm_up=warm_up * 60,
                speed=speed,
                work_seconds=work,
                settings=parse_toml(settings.read_bytes()) if settings else {},
                disturbances=Disturbances(loss=loss, speed_spread=speed_spread),
            )
            given = read_orders(orders, model, case.operations()) if orders else case.demand
            demand = replace(given, backlog=backlog or given.backlog)
            cases += [replace(case, robots=size, demand=demand) for size in sizes]
        with executor_for(on, jobs, runs=len(cases) * len(numbers) * parts) as executor:
            figures, missing = simulate_all(cases, executor, seeds=numbers, parts=parts, tell=_tell_progress)
    except (PlantModelError, ValueError) as error:
        typer.echo(f"nena simulate: {error}", err=True)
        raise typer.Exit(2) from error
    except SimulationFailedError as error:
        typer.echo(
            f"nena simulate: a simulated program has failed, so there are no figures: {error}", err=True
        )
        typer.echo("This is a bug; please report it with the traceback above.", err=True)
        raise typer.Exit(1) from error
    _write_report(
        Report(tuple(figures), tuple(numbers), parts, tuple(missing)), models, json, markdown, heat_maps
    )
    simulated = sum(each.hours for each in figures)
    typer.echo(f"{simulated:g} hours simulated in {perf_counter() - begun:.0f} s", err=True)
    if idle := [f"{each.robots} robots in {each.plant}" for each in figures if not each.finished]:
        typer.echo(
            f"nena simulate: no order finished with {', '.join(idle)}; the report has the reasons", err=True
        )
    for each in missing:
        typer.echo(f"nena simulate: the report is incomplete: {each}", err=True)
    if idle or missing:
        raise typer.Exit(1)


def _tell_progress(text: str) -> None:
    typer.echo(text, err=True)


def _write_report(
    report: Report,
    plants: Mapping[str, PlantModel],
    json: Path | None,
    markdown: Path | None,
    pictures: Path | None,
) -> None:
    typer.echo(report.to_text())
    if json:
        json.write_text(report.to_json(), encoding="utf-8")
    if markdown:
        markdown.write_text(report.to_markdown(), encoding="utf-8")
    if pictures:
        _draw_pictures(pictures, plants, report.figures)
