"""``nena audit``: who changed what, and whether the audit trail is intact."""

from __future__ import annotations

from datetime import datetime
from itertools import chain
from typing import Annotated

import typer

from nena_cli import tables
from nena_cli.options import Format, group
from nena_cli.output import REFUSED, fail, print_json
from nena_cli.service import Service, of_service
from nena_client.exchange import Query
from nena_shared.fleet_api.audit import AuditEntry, AuditMark, AuditResult, ChainCheck
from nena_shared.fleet_api.operations.fleet import LIST_AUDIT

app = group()

User = Annotated[str | None, typer.Option(help="Only requests of this user.")]
Operation = Annotated[str | None, typer.Option(help="Only this operation, such as withdraw.")]
Object = Annotated[str | None, typer.Option("--object", help="Only requests for the object of this name.")]
Result = Annotated[AuditResult | None, typer.Option(help="Only requests with this result.")]
Since = Annotated[datetime | None, typer.Option(help="Only requests since this local time.")]
Until = Annotated[datetime | None, typer.Option(help="Only requests before this local time.")]
Limit = Annotated[int, typer.Option(min=1, help="Maximum number of rows, the newest ones.")]
Expected = Annotated[
    str | None,
    typer.Option("--expect", help="SEQUENCE:HASH of an earlier check; that row must not have changed."),
]
PAGE = 1000


@app.command("list")
@of_service
def list_(
    service: Service,
    *,
    user: User = None,
    operation: Operation = None,
    object_: Object = None,
    result: Result = None,
    since: Since = None,
    until: Until = None,
    limit: Limit = 100,
) -> None:
    """List who changed what, newest first."""
    query: Query = {
        "user": user,
        "operation": operation,
        "object": object_,
        "result": result,
        "since": since,
        "until": until,
    }
    found: list[AuditEntry] = []
    with service.connected() as connection:
        for page in connection.pages(LIST_AUDIT, {**query, "limit": min(limit, PAGE)}):
            found += page.entries
            if len(found) >= limit:
                break
    service.print_all(tables.audit_table, *found[:limit])


@app.command()
@of_service
def export(service: Service) -> None:
    """Print all rows, oldest first, as a line of JSON per row."""
    with service.connected() as connection:
        for page in connection.pages(LIST_AUDIT, {"limit": PAGE, "oldestFirst": True}):
            for entry in page.entries:
                print_json(entry)


@app.command()
@of_service
def verify(service: Service, *, expected: Expected = None) -> None:
    """Check that no row was changed, removed or inserted; exit status 1 if one was."""
    try:
        known = AuditMark.parse(expected) if expected else None
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
    check = ChainCheck(known)
    with service.connected() as connection:
        pages = connection.pages(LIST_AUDIT, {"limit": PAGE, "oldestFirst": True})
        problem = next(chain.from_iterable(map(check.problems, pages)), None)
    if problem:
        fail(f"The audit trail is not intact: {tables.printable(problem)}", REFUSED)
    if service.output in (Format.TABLE, Format.WIDE):
        typer.echo(f"The audit trail is intact: {check.rows} rows, the last one {check.last}")
    else:
        service.print_one(check.last)
