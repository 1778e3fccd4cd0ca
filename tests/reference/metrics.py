"""Writes docs/metrics.md: every metric of every program, from the tables that the programs read."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final

from nena_edge_agent import extension as agent_extension
from nena_edge_agent import metrics as edge_agent
from nena_order_service import extension as order_service_extension
from nena_order_service.api import metrics as order_service
from nena_shared.metrics import Metric, MetricKind, Section, gauge
from nena_status_aggregator import extension as aggregator_extension
from nena_status_aggregator.metrics import exposition, robot_series
from support.markdown import row

_HERE: Final = Path(__file__).parent
DOCUMENT: Final = _HERE.parents[1] / "docs" / "metrics.md"

ROBOT_LABELS: Final = ("manufacturer", "serial_number")


def robot_metrics() -> Iterator[Metric[object]]:
    """Yield the metrics of single robots, which the aggregator writes by hand."""
    yield gauge(
        robot_series.CONDITION, robot_series.CONDITION_TEXT, lambda _: None, *ROBOT_LABELS, "condition"
    )
    heads = [(series.name, series.kind, series.text) for series in robot_series.OF_ROBOT]
    heads += [(series.name, series.kind, series.text) for series in robot_series.OF_STATE]
    for name, kind, text in heads:
        yield Metric(name, MetricKind(kind), text, ROBOT_LABELS, lambda _: None)


PROGRAMS: Final[dict[str, tuple[Section[Any], ...]]] = {
    "Order service": (
        *order_service.SECTIONS,
        *(each.section for each in order_service_extension.installed().values() if each.section),
    ),
    "Edge agent": (
        *edge_agent.SECTIONS,
        *(section for each in agent_extension.installed().values() if (section := each.metrics())),
    ),
    "Status aggregator": (
        *exposition.SECTIONS,
        *(each.section for each in aggregator_extension.installed().values() if each.section),
        Section("Single robots", tuple(robot_metrics())),
    ),
}


def metrics() -> Iterator[Metric[Any]]:
    """Yield all metrics of all programs."""
    for sections in PROGRAMS.values():
        for section in sections:
            yield from section.metrics


def document() -> str:
    """Return the whole text."""
    parts = [(_HERE / "metrics_introduction.md").read_text(encoding="utf-8")]
    for program, sections in PROGRAMS.items():
        parts.append(f"## {program}\n")
        parts += [_section(each) for each in sections]
    parts.append((_HERE / "metrics_prometheus.md").read_text(encoding="utf-8"))
    return "\n".join(parts)


def _section(section: Section[Any]) -> str:
    text = [section.text, ""] if section.text else []
    return "\n".join([f"### {section.title}", "", *text, *_table(section.metrics), ""])


def _table(shown: Iterable[Metric[Any]]) -> list[str]:
    head = ("metric", "type", "labels", "meaning")
    rows = (
        (f"`{each.name}`", each.kind.value, ", ".join(f"`{label}`" for label in each.labels), each.text)
        for each in shown
    )
    return [row(head), row("---" for _ in head), *map(row, rows)]


if __name__ == "__main__":
    DOCUMENT.write_text(document(), encoding="utf-8")
