"""Transport orders in CSV files, for ``nena orders import``."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from datetime import datetime
from typing import Any, Final

import typer
from pydantic import ValidationError

from nena_cli.arguments import parse_stop
from nena_shared.findings import FINDINGS_SHOWN
from nena_shared.fleet_api.transport_order import TransportOrderRequest
from nena_shared.vda5050.malformed import problems_of

STOPS: Final = "stops"
BETWEEN_STOPS: Final = ">"
COLUMNS: Final = (STOPS, "name", "priority", "deadline", "intendedVehicle", "type", "dependencies")
"""Columns of a file; only ``stops`` is required."""
DELIMITERS: Final = ",;\t"


def read_orders(lines: Iterable[str]) -> Iterator[tuple[int, TransportOrderRequest]]:
    """Yield each order with the number of its line.

    An order's name is its idempotency key too, so that importing the same file again creates nothing twice.

    Raises:
        typer.BadParameter: a column or a value is wrong.
    """
    try:
        text = list(lines)
    except UnicodeDecodeError as error:
        raise typer.BadParameter("The file is not in UTF-8. Save it as CSV UTF-8.") from error
    header = text[0].removeprefix("\ufeff") if text else ""
    delimiter = max(DELIMITERS, key=header.count)
    rows = csv.DictReader([header, *text[1:]], delimiter=delimiter)
    columns = [fieldname.strip() for fieldname in rows.fieldnames or ()]
    unknown = sorted(set(columns) - set(COLUMNS))
    if STOPS not in columns or unknown:
        hint = f"Known columns: {', '.join(COLUMNS)}"
        message = f"Unknown column {unknown[0]!r}. {hint}" if unknown else f"No column {STOPS!r}. {hint}"
        raise typer.BadParameter(message)
    rows.fieldnames = columns
    while True:
        try:
            row = next(rows, None)
            if row is None:
                return
            yield rows.line_num, _order_of_row(row)
        except (typer.BadParameter, ValidationError, csv.Error) as error:
            problems = (
                problems_of(error, FINDINGS_SHOWN) if isinstance(error, ValidationError) else [str(error)]
            )
            raise typer.BadParameter(f"Line {rows.line_num}: {'; '.join(problems)}") from error


def _order_of_row(row: dict[str | Any, Any]) -> TransportOrderRequest:
    if None in row:
        raise typer.BadParameter("more values than columns")
    given = {name: value.strip() for name, value in row.items() if value and value.strip()}
    stops = [parse_stop(each.strip()) for each in given.pop(STOPS, "").split(BETWEEN_STOPS) if each.strip()]
    fields: dict[str, Any] = dict(given)
    if "dependencies" in fields:
        fields["dependencies"] = fields["dependencies"].split()
    if "name" in fields:
        fields["idempotencyKey"] = fields["name"]
    if "priority" in fields:
        fields["priority"] = _whole_number(fields["priority"])
    if "deadline" in fields:
        fields["deadline"] = _parse_moment(fields["deadline"])
    fields["destinations"] = [stop.model_dump(by_alias=True, exclude_unset=True) for stop in stops]
    return TransportOrderRequest.model_validate(fields)


def _parse_moment(text: str) -> datetime:
    """Parse a moment; without a zone it is in local time, as for ``nena orders create``."""
    try:
        return datetime.fromisoformat(text).astimezone()
    except ValueError as error:
        raise typer.BadParameter(f"deadline {text!r} is not a moment such as 2026-12-01T14:30") from error


def _whole_number(text: str) -> int:
    try:
        return int(text)
    except ValueError as error:
        raise typer.BadParameter(f"priority {text!r} is not a whole number") from error
