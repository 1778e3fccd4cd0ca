"""``nena``: one command, with a group of commands for each subject."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points

import typer

from nena_cli.conversations import app as vda5050
from nena_cli.orders import app as orders
from nena_cli.plants import app as plant
from nena_cli.sequences import app as sequences
from nena_cli.vehicles import app as vehicles
from nena_cli.vehicles import dispatch, traffic
from nena_cli.zones import app as zones
from nena_shared import log
from nena_shared.settings import LogSettings

COMMANDS = "nena.commands"
"""Entry points of commands that other distributions add, such as ``simulate`` of nena-simulate."""

app = typer.Typer(help="NeNa: fleets of VDA 5050 robots.", no_args_is_help=True, add_completion=False)
app.add_typer(orders, name="orders")
app.add_typer(sequences, name="sequences")
app.add_typer(vehicles, name="vehicles")
app.command()(dispatch)
app.command()(traffic)
app.add_typer(zones, name="zones")
app.add_typer(plant, name="plant")
app.add_typer(vda5050, name="vda5050")


def _passed_on(command: EntryPoint) -> Callable[[typer.Context], None]:
    """Return a command that loads the other distribution only when it is called."""

    def run(context: typer.Context) -> None:
        command.load()(context.args)

    return run


for each in sorted(entry_points(group=COMMANDS)):
    app.command(
        each.name,
        help=f"See nena {each.name} --help.",
        context_settings={
            "allow_extra_args": True,
            "ignore_unknown_options": True,
            "help_option_names": [],
        },
    )(_passed_on(each))


@app.callback()
def root() -> None:
    """NeNa: fleets of VDA 5050 robots."""
    log.configure(LogSettings(level="warning"))


if __name__ == "__main__":
    app()
