"""``nena``: one command, with a group of commands for each subject."""

from __future__ import annotations

import typer

from nena_cli.conversations import app as vda5050
from nena_cli.orders import app as orders
from nena_cli.plants import app as plant
from nena_cli.sequences import app as sequences
from nena_cli.vehicles import app as vehicles
from nena_cli.vehicles import dispatch
from nena_cli.zones import app as zones
from nena_shared import log
from nena_shared.settings import LogSettings

app = typer.Typer(help="NeNa: fleets of VDA 5050 robots.", no_args_is_help=True, add_completion=False)
app.add_typer(orders, name="orders")
app.add_typer(sequences, name="sequences")
app.add_typer(vehicles, name="vehicles")
app.command()(dispatch)
app.add_typer(zones, name="zones")
app.add_typer(plant, name="plant")
app.add_typer(vda5050, name="vda5050")


@app.callback()
def root() -> None:
    """NeNa: fleets of VDA 5050 robots."""
    log.configure(LogSettings(level="warning"))


if __name__ == "__main__":
    app()
