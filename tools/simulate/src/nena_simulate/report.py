"""The result of a simulation: figures for each fleet size, as text, Markdown and JSON."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from math import ceil
from statistics import quantiles
from typing import Any

from nena_simulate.observation import Doing, Observed

UNFINISHED = ("orders", "state", "code", "reason")
CAUSES, PLACES = 8, 12
"""Maximum numbers of causes and places in the text; JSON contains all of them."""


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
    """Performance of one fleet size."""

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

    @classmethod
    def of(cls, found: Observed, *, robots: int) -> Figures:
        """Return the figures for what was observed."""
        total, hours = sum(found.seconds.values()) or 1.0, found.hours
        doing = {each.value: round(found.seconds[each] / total, 4) for each in Doing}
        leads = sorted(found.leads)
        cuts = quantiles(leads, n=100, method="inclusive") if len(leads) > 1 else None
        driven = found.empty + found.loaded
        return cls(
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
    """The figures for all fleet sizes of a simulation, and its parameters."""

    plant: str
    seed: int
    figures: tuple[Figures, ...]
    parts: int = 1
    """Number of parts that were simulated separately, each with the next seed."""

    def to_json(self) -> str:
        """Return the whole report as JSON."""
        return json.dumps(asdict(self), indent=2, ensure_ascii=False) + "\n"

    def to_markdown(self) -> str:
        """Return tables in Markdown."""
        parts = [f"# {self._title_of}", *self._notes_of(), _markdown_table(self._rows_of())]
        for figure in self.figures:
            if figure.unfinished:
                parts.append(f"## Orders that did not finish with {figure.robots} robots")
                parts.append(_markdown_table([UNFINISHED, *_unfinished_rows(figure)]))
            parts.append(f"## Waiting with {figure.robots} robots, robot minutes per hour")
            parts.append(_markdown_table([("why", "minutes"), *_first_rows(figure.waiting_by_cause, CAUSES)]))
            parts.append(
                _markdown_table([("where", "minutes"), *_first_rows(figure.waiting_by_place, PLACES)])
            )
        return "\n\n".join(parts) + "\n"

    def to_text(self) -> str:
        """Return tables for a terminal."""
        parts = [self._title_of, *self._notes_of(), _text_table(self._rows_of())]
        for figure in self.figures:
            if figure.unfinished:
                parts.append(f"Orders that did not finish with {figure.robots} robots:")
                parts.append("\n".join("  ".join(row) for row in _unfinished_rows(figure)))
            parts.append(f"Waiting with {figure.robots} robots, robot minutes per hour:")
            parts.append(_text_table(_first_rows(figure.waiting_by_cause, CAUSES)))
            parts.append(_text_table(_first_rows(figure.waiting_by_place, PLACES)))
        return "\n\n".join(filter(None, parts)) + "\n"

    def _notes_of(self) -> list[str]:
        return list(dict.fromkeys(note for figure in self.figures for note in figure.notes))

    @property
    def _title_of(self) -> str:
        seeds = (
            f"seed {self.seed}" if self.parts == 1 else f"seeds {self.seed} to {self.seed + self.parts - 1}"
        )
        return f"{self.plant}, {seeds}"

    def _rows_of(self) -> list[tuple[str, ...]]:
        """Return a table with a column for each fleet size."""
        shown: list[tuple[str, Callable[[Figures], Any]]] = [
            ("robots", lambda one: one.robots),
            ("orders per hour", lambda one: one.orders_per_hour),
            ("orders finished", lambda one: one.finished),
            ("orders failed", lambda one: one.failed),
            ("orders waiting at the end", lambda one: one.waiting),
            ("lead time p50, s", lambda one: "-" if one.lead_p50 is None else one.lead_p50),
            ("lead time p95, s", lambda one: "-" if one.lead_p95 is None else one.lead_p95),
            ("utilisation", lambda one: f"{one.utilisation:.0%}"),
            *(
                (f"  {doing.value}", lambda one, doing=doing: f"{one.doing[doing.value]:.0%}")
                for doing in Doing
            ),
            ("driven, km", lambda one: one.driven_km),
            ("driven empty", lambda one: f"{one.empty_share:.0%}"),
        ]
        return [(name, *(str(show(figure)) for figure in self.figures)) for name, show in shown]


def _unfinished_rows(figure: Figures) -> list[tuple[str, ...]]:
    """Return a row for each of the most frequent reasons; "|" would end a cell."""
    return [
        (str(each.orders), each.state, each.code, each.reason.replace("|", "/"))
        for each in figure.unfinished[:CAUSES]
    ]


def _first_rows(values: Mapping[str, float], count: int) -> list[tuple[str, ...]]:
    shown = list(values.items())[:count]
    return [(name, f"{value:.1f}") for name, value in shown]


def _markdown_table(rows: Sequence[Sequence[str]]) -> str:
    head, *rest = rows
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rest]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _text_table(rows: Sequence[Sequence[str]]) -> str:
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))] if rows else []
    return "\n".join(
        "  ".join(
            cell.rjust(width) if column else cell.ljust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    )
