"""The result of a simulation: figures for each fleet size, as text, Markdown and JSON."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import groupby
from math import ceil, sqrt
from statistics import quantiles, stdev
from typing import Any

from nena_simulate.observation import Doing, Observed

Row = tuple[str, ...]
UNFINISHED: Row = ("orders", "state", "code", "reason")
CAUSES, PLACES = 8, 12
"""Maximum numbers of causes and places in the text; JSON contains all of them."""
RANDOM = ("orders_per_hour", "lead_p50", "lead_p95", "utilisation")
"""Figures that get a confidence interval."""
STUDENT_95 = (12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23, 2.20, 2.18, 2.16, 2.14, 2.13, 2.12)
"""Two-sided 95 % quantiles of Student's t by degrees of freedom, from 1 on; the last one is used for more."""


@dataclass(frozen=True, slots=True)
class Unfinished:
    """Orders that did not finish for the same reason."""

    state: str
    """State of the orders: FAILED, UNROUTABLE, or DISPATCHABLE: no robot got them before the end."""
    code: str
    """Code of the reason."""
    reason: str
    """Reason as text, without names of robots and places."""
    orders: int


@dataclass(frozen=True, slots=True)
class Figures:
    """Performance of one fleet size in a plant."""

    plant: str
    robots: int
    hours: float
    created: int
    finished: int
    finished_by_minute: tuple[int, ...]
    failed: int
    waiting: float
    """Number of orders without a robot at the end."""
    orders_per_hour: float
    lead_p50: float | None
    """Median lead time, seconds from an order's creation to its end; None: no order ended."""
    lead_p95: float | None
    utilisation: float
    """Share of the robots' time with an order."""
    doing: Mapping[str, float]
    """Share of the robots' time by activity."""
    driven_km: float
    empty_share: float
    """Share of the distance that robots drive without a load."""
    waiting_by_cause: Mapping[str, float]
    """Robot minutes per hour by cause."""
    waiting_by_place: Mapping[str, float]
    """Robot minutes per hour by the path in front of the robot, or by its point."""
    unfinished: tuple[Unfinished, ...] = ()
    """Why orders did not finish, the most frequent reason first."""
    notes: Sequence[str] = ()
    """What limits the meaning of the figures."""
    runs: int = 1
    """Number of runs with their own seeds."""
    intervals: Mapping[str, float] = field(default_factory=dict)
    """Half the 95 % confidence interval of the mean of a run, by figure; empty: a single run."""

    @classmethod
    def of(cls, runs: Sequence[Observed], *, plant: str, robots: int) -> Figures:
        """Return the figures for what was observed in some runs."""
        whole = cls._of_one(Observed.joined(runs), plant=plant, robots=robots)
        single = [asdict(cls._of_one(run, plant=plant, robots=robots)) for run in runs]
        intervals = {name: _half_interval([each[name] for each in single]) for name in RANDOM}
        known = {name: half for name, half in intervals.items() if half is not None}
        return replace(whole, runs=len(runs), intervals=known)

    @classmethod
    def _of_one(cls, found: Observed, *, plant: str, robots: int) -> Figures:
        total, hours = sum(found.seconds.values()) or 1.0, found.hours
        doing = {each.value: round(found.seconds[each] / total, 4) for each in Doing}
        leads = sorted(found.leads)
        cuts = quantiles(leads, n=100, method="inclusive") if len(leads) > 1 else None
        driven = found.empty + found.loaded
        return cls(
            plant=plant,
            robots=robots,
            hours=hours,
            created=found.created,
            finished=len(leads),
            finished_by_minute=_by_minute(found.finishes, hours),
            failed=found.failed,
            waiting=found.waiting,
            orders_per_hour=round(len(leads) / hours, 1),
            lead_p50=round(cuts[49], 1) if cuts else None,
            lead_p95=round(cuts[94], 1) if cuts else None,
            utilisation=round(1 - doing[Doing.IDLE], 4),
            doing=doing,
            driven_km=round(driven / 1000, 2),
            empty_share=round(found.empty / driven, 4) if driven else 0.0,
            waiting_by_cause=_per_hour(found.causes, hours),
            waiting_by_place=_per_hour(found.places, hours),
            unfinished=tuple(Unfinished(*why, count) for why, count in found.unfinished.most_common()),
            notes=found.notes,
        )


def _half_interval(values: Sequence[float | None]) -> float | None:
    """Return half the 95 % confidence interval of the mean; None: too few values."""
    known = [value for value in values if value is not None]
    if len(known) < 2:  # noqa: PLR2004 - a deviation takes two
        return None
    student = STUDENT_95[min(len(known) - 1, len(STUDENT_95)) - 1]
    return round(student * stdev(known) / sqrt(len(known)), 4)


def _by_minute(moments: Sequence[float], hours: float) -> tuple[int, ...]:
    """Return the number of ``moments`` (seconds) in each minute."""
    minutes = Counter(int(moment // 60) for moment in moments)
    return tuple(minutes[each] for each in range(ceil(hours * 60)))


def _per_hour(seconds: Mapping[str, float], hours: float) -> dict[str, float]:
    """Return robot minutes per hour, highest first."""
    most_first = sorted(seconds.items(), key=lambda each: (-each[1], each[0]))
    return {name: round(value / 60 / hours, 2) for name, value in most_first}


@dataclass(frozen=True, slots=True)
class Report:
    """The figures for all plants and fleet sizes of a simulation, plant by plant, and its parameters."""

    figures: tuple[Figures, ...]
    seeds: tuple[int, ...]
    parts: int = 1
    """Number of parts that were simulated separately, each with the next seed."""
    missing: tuple[str, ...] = ()
    """Runs without a result, and why."""

    def to_json(self) -> str:
        """Return the whole report as JSON."""
        return json.dumps(asdict(self), indent=2, ensure_ascii=False) + "\n"

    def to_markdown(self) -> str:
        """Return tables in Markdown."""
        shown = [
            (f"{'#' * level} {title}", *notes, *([_markdown_table(rows)] if rows else []))
            for level, title, notes, rows in self._sections()
        ]
        return "\n\n".join(text for section in shown for text in section) + "\n"

    def to_text(self) -> str:
        """Return tables for a terminal."""
        shown = [(title, *notes, _text_table(rows)) for _, title, notes, rows in self._sections()]
        return "\n\n".join(text for section in shown for text in section if text) + "\n"

    def _sections(self) -> Iterator[tuple[int, str, Sequence[str], list[Row]]]:
        """Yield the level, title, notes and table of each section."""
        plants = {name: list(figures) for name, figures in groupby(self.figures, lambda each: each.plant)}
        compared = len(plants) > 1
        missing = [f"Without a result: {each}" for each in self.missing]
        if compared:
            yield 1, f"Orders per hour, {self._seeds}", missing, _compared(plants)
        for plant, figures in plants.items():
            notes = list(dict.fromkeys(note for figure in figures for note in figure.notes))
            level = 2 if compared else 1
            title = plant if compared else f"{plant}, {self._seeds}"
            yield level, title, notes if compared else [*missing, *notes], _rows_of(figures)
            for figure in figures:
                if figure.unfinished:
                    title = f"Orders that did not finish with {figure.robots} robots"
                    yield level + 1, title, (), [UNFINISHED, *_unfinished_rows(figure)]
                causes = _first_rows(figure.waiting_by_cause, CAUSES)
                places = _first_rows(figure.waiting_by_place, PLACES)
                title = f"Waiting with {figure.robots} robots, robot minutes per hour"
                yield level + 1, title, (), [("why", "minutes"), *causes]
                yield (
                    level + 1,
                    f"Where they wait with {figure.robots} robots",
                    (),
                    [("where", "minutes"), *places],
                )

    @property
    def _seeds(self) -> str:
        seeds = [seed + part for seed in self.seeds for part in range(self.parts)]
        if seeds != list(range(seeds[0], seeds[-1] + 1)):
            return f"seeds {', '.join(map(str, seeds))}"
        return f"seed {seeds[0]}" if len(seeds) == 1 else f"seeds {seeds[0]} to {seeds[-1]}"


def _compared(plants: Mapping[str, Sequence[Figures]]) -> list[Row]:
    """Return orders per hour by plant and fleet size."""
    rates = {(plant, each.robots): each for plant, figures in plants.items() for each in figures}
    sizes = sorted({robots for _, robots in rates})
    rows: list[Row] = [("plant", *(f"{size} robots" for size in sizes))]
    for plant in plants:
        found = [rates.get((plant, size)) for size in sizes]
        rows.append((plant, *(_with_interval(each, "orders_per_hour") if each else "-" for each in found)))
    return rows


def _with_interval(figure: Figures, name: str) -> str:
    value, half = getattr(figure, name), figure.intervals.get(name)
    if value is None:
        return "-"
    unit = "%" if name == "utilisation" else ""
    scale, places = (100, 0) if unit else (1, 1)
    shown = f"{value * scale:.{places}f}"
    return f"{shown}{unit}" if half is None else f"{shown} ± {half * scale:.{places or 1}f}{unit}"


def _rows_of(figures: Sequence[Figures]) -> list[Row]:
    """Return a table with a column for each fleet size."""
    shown: list[tuple[str, Callable[[Figures], Any]]] = [
        ("robots", lambda one: one.robots),
        ("orders per hour", lambda one: _with_interval(one, "orders_per_hour")),
        ("orders finished", lambda one: one.finished),
        ("orders failed", lambda one: one.failed),
        ("orders waiting at the end", lambda one: one.waiting),
        ("lead time p50, s", lambda one: _with_interval(one, "lead_p50")),
        ("lead time p95, s", lambda one: _with_interval(one, "lead_p95")),
        ("utilisation", lambda one: _with_interval(one, "utilisation")),
        *((f"  {doing.value}", lambda one, doing=doing: f"{one.doing[doing.value]:.0%}") for doing in Doing),
        ("driven, km", lambda one: one.driven_km),
        ("driven empty", lambda one: f"{one.empty_share:.0%}"),
    ]
    return [(name, *(str(show(figure)) for figure in figures)) for name, show in shown]


def _unfinished_rows(figure: Figures) -> list[Row]:
    """Return a row for each of the most frequent reasons; "|" would end a cell."""
    return [
        (str(each.orders), each.state, each.code, each.reason.replace("|", "/"))
        for each in figure.unfinished[:CAUSES]
    ]


def _first_rows(values: Mapping[str, float], count: int) -> list[Row]:
    shown = list(values.items())[:count]
    return [(name, f"{value:.1f}") for name, value in shown]


def _markdown_table(rows: Sequence[Row]) -> str:
    head, *rest = rows
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rest]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _text_table(rows: Sequence[Row]) -> str:
    """Align columns: numbers to the right, words to the left."""
    columns = list(zip(*rows, strict=True))
    widths = [max(map(len, column)) for column in columns]
    right = [column[-1][:1].isdigit() for column in columns]
    return "\n".join(
        "  ".join(
            cell.rjust(width) if number else cell.ljust(width)
            for cell, width, number in zip(row, widths, right, strict=True)
        ).rstrip()
        for row in rows
    )
