"""``nena zones``: zone sets of VDA 5050 3.0 at a running order service."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated
from urllib.parse import quote

import typer
from pydantic_core import from_json

from nena_cli.fleet import tables
from nena_cli.fleet.shell import WRONG, AsJson, Token, TokenFile, Urls, connected, put_all, say
from nena_shared.fleet_api.zone_set import ZoneSetList, ZoneSetStatus

app = typer.Typer(help="Zone sets of a running order service.", no_args_is_help=True)

ZONE_SETS = "/v1/zoneSets"

Name = Annotated[str, typer.Argument(help="zoneSetId of the zone set.")]


@app.command("list")
def list_(
    *, url: Urls = None, token: Token = None, token_file: TokenFile = None, as_json: AsJson = False
) -> None:
    """List the zone sets, and how they stand at the robots."""
    with connected(url, token, token_file) as connection:
        found = connection.get(ZoneSetList, ZONE_SETS)
    _put(*found.zone_sets, as_json=as_json)


@app.command()
def put(
    file: Annotated[Path, typer.Argument(help="The standard's zoneSet object, as JSON.")],
    *,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
) -> None:
    """Put a zone set at the order service; robots of 3.0 get it, disabled."""
    try:
        body = from_json(file.read_bytes())
    except (OSError, ValueError) as error:
        say(f"nena: {file}: {error}", style="red")
        raise typer.Exit(WRONG) from error
    with connected(url, token, token_file) as connection:
        _put(connection.post(ZoneSetStatus, ZONE_SETS, body), as_json=as_json)


@app.command()
def enable(
    name: Name,
    *,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
) -> None:
    """Have robots use a zone set, and no other one of its map."""
    with connected(url, token, token_file) as connection:
        done = connection.post(ZoneSetStatus, f"{ZONE_SETS}/{quote(name, safe='')}/enable", {})
    _put(done, as_json=as_json)


@app.command()
def delete(
    name: Name,
    *,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
) -> None:
    """Have robots delete a zone set."""
    with connected(url, token, token_file) as connection:
        done = connection.delete(ZoneSetStatus, f"{ZONE_SETS}/{quote(name, safe='')}")
    _put(done, as_json=as_json)


def _put(*zone_sets: ZoneSetStatus, as_json: bool) -> None:
    put_all(zone_sets, tables.zone_sets_table, as_json=as_json)
