"""``nena``: one command, with a group of commands for each subject, loaded when it is called."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from importlib import import_module
from inspect import Parameter
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from nena_cli.options import PLAIN, group

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

ENTRY_POINTS: Final = "nena.commands"
"""Entry points of commands that other distributions add, such as ``simulate`` of nena-simulate."""


@dataclass(frozen=True, slots=True)
class Command:
    """A command or a group of commands, and where it is defined."""

    module: str
    name: str
    help: str
    """One line, in the list of commands; also the help of a group."""

    def load(self) -> Any:  # noqa: ANN401 - Typer's own copy of click has no public types
        """Import the module and return the command."""
        from nena_shared import model_building  # noqa: PLC0415 - help needs nothing of it

        model_building.deferred = True
        found = getattr(import_module(self.module), self.name)
        if isinstance(found, typer.Typer):
            found.info.help = self.help
            return get_command(found)
        single = typer.Typer(add_completion=False, rich_markup_mode=PLAIN)
        single.command()(found)
        return get_command(single)


COMMANDS: Final = {
    "status": Command("nena_cli.diagnosis", "status", "Show what runs, what needs a person and what to do."),
    "explain": Command("nena_cli.diagnosis", "explain", "Show why an order or a vehicle is waiting."),
    "orders": Command("nena_cli.orders", "app", "Transport orders."),
    "sequences": Command("nena_cli.sequences", "app", "Order sequences."),
    "schedules": Command("nena_cli.schedules", "app", "Schedules: recurring orders."),
    "vehicles": Command("nena_cli.vehicles", "app", "Vehicles."),
    "dispatch": Command("nena_cli.dispatch", "dispatch", "Send a vehicle to a destination."),
    "traffic": Command("nena_cli.traffic", "traffic", "Show where vehicles will be in the next minute."),
    "points": Command("nena_cli.places", "points", "Points, and the vehicles that use them."),
    "paths": Command("nena_cli.places", "paths", "Paths: which are locked, lock and unlock them."),
    "locations": Command("nena_cli.places", "locations", "Locations: what they offer, and at which points."),
    "stops": Command("nena_cli.stops", "app", "Stops: pause all robots, or those in an area."),
    "zones": Command("nena_cli.zones", "app", "Zone sets (VDA 5050 3.0)."),
    "peripherals": Command(
        "nena_cli.peripherals", "app", "Peripheral devices, such as doors, and their jobs."
    ),
    "recordings": Command("nena_cli.recordings", "app", "Recordings and log reports of robots."),
    "audit": Command("nena_cli.audit", "app", "Who changed what, and whether the audit trail is intact."),
    "plant": Command(
        "nena_cli.plants", "app", "Plant models: openTCS XML, LIF, Nav2's route graphs, NeNa's JSON."
    ),
    "vda5050": Command(
        "nena_cli.conversations", "app", "Record, replay, show and check VDA 5050 conversations."
    ),
}


class Commands(TyperGroup):
    """The commands; imports the one that is called, so that the others cost no time."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ANN401, ARG002 - see Command.load
        """Return the names of all commands."""
        return [*COMMANDS, *sorted(_added_commands())]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ANN401 - see Command.load
        """Return a command with name and help only, for lists of commands."""
        if found := COMMANDS.get(cmd_name):
            return TyperCommand(cmd_name, help=found.help)
        if added := _added_commands().get(cmd_name):
            return _passed_on(added)
        return super().get_command(ctx, cmd_name)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # noqa: ANN401 - see Command.load
        """Return the command that is called."""
        if args and (found := COMMANDS.get(args[0])):
            return args[0], found.load(), args[1:]
        names = self.list_commands(ctx)
        if args and args[0] not in names and (alike := get_close_matches(args[0], names)):
            ctx.fail(f"No such command {args[0]!r}. Did you mean {' or '.join(map(repr, alike))}?")
        return super().resolve_command(ctx, args)


def _print_version(wanted: bool) -> None:  # noqa: FBT001 - the callback of an option
    if wanted:
        from importlib.metadata import version  # noqa: PLC0415 - other commands start faster without it

        typer.echo(f"nena {version('nena-cli')}")
        raise typer.Exit


Version = Annotated[
    bool,
    typer.Option(
        "--version", "-V", callback=_print_version, is_eager=True, help="Show the version and exit."
    ),
]
app = group(
    Parameter("version", Parameter.KEYWORD_ONLY, default=False, annotation=Version),
    hidden=False,
    cls=Commands,
    help="NeNa: fleets of VDA 5050 robots.",
)


@cache
def _added_commands() -> dict[str, EntryPoint]:
    """Return the commands of other distributions by name."""
    from importlib.metadata import entry_points  # noqa: PLC0415 - it reads every distribution's files

    return {point.name: point for point in entry_points(group=ENTRY_POINTS)}


def _passed_on(command: EntryPoint) -> Any:  # noqa: ANN401 - see Command.load
    """Return a command that loads the other distribution only when it is called."""

    def run(context: typer.Context) -> None:
        command.load()(context.args)

    single = typer.Typer(add_completion=False, rich_markup_mode=PLAIN)
    single.command(
        command.name,
        help=command.dist.metadata["Summary"] if command.dist else None,
        context_settings={
            "allow_extra_args": True,
            "ignore_unknown_options": True,
            "help_option_names": [],
        },
    )(run)
    return get_command(single)


if __name__ == "__main__":
    app()
