"""``nena-deploy``: the commands for a site, its identities and users."""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from importlib.metadata import version
from pathlib import Path, PurePosixPath
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from nena_deploy.authority import expiry
from nena_deploy.identities import IdentityError, Kind, SiteTopics, device_name, host_name, robot_name
from nena_deploy.site import LONGEST_MESSAGE, BrokerError, BusyError, Site, SiteError, locked
from nena_shared.fleet_api.base import Role
from nena_shared.settings import ConfigurationError
from nena_shared.vda5050.topics import RobotKey
from nena_shared.web.users import NAME, User, hash_of, new_token, read_users, write_users

WRONG = 2
"""Exit status of a command that failed."""


def say(text: str) -> None:
    """Print a message for people on standard error; standard output holds results only."""
    typer.echo(text, err=True)


@contextmanager
def errors_reported() -> Iterator[None]:
    """Report an expected error in one line and exit with status 2."""
    try:
        yield
    except (SiteError, BusyError, IdentityError, ConfigurationError, OSError) as error:
        say(f"nena-deploy: {error}")
        raise typer.Exit(WRONG) from error


app = typer.Typer(
    help="Certificates, broker access rights and users of a NeNa site.",
    no_args_is_help=True,
    add_completion=False,
)


def _print_version(wanted: bool) -> None:  # noqa: FBT001 - the callback of an option
    if wanted:
        typer.echo(f"nena-deploy {version('nena-deploy')}")
        raise typer.Exit


@app.callback()
def site(
    *,
    version: Annotated[
        bool,
        typer.Option(
            "--version", "-V", callback=_print_version, is_eager=True, help="Show the version and exit."
        ),
    ] = False,
) -> None:
    """Certificates, broker access rights and users of a NeNa site."""


robot = typer.Typer(help="Robots: each has its own certificate and broker rights.", no_args_is_help=True)
host = typer.Typer(help="Hosts (WMS, MES): each creates orders under its own name.", no_args_is_help=True)
device = typer.Typer(help="Peripheral devices (doors, lifts): each has its own topics.", no_args_is_help=True)
user = typer.Typer(help="Users of the panel and the REST APIs.", no_args_is_help=True)
app.add_typer(robot, name="robot")
app.add_typer(host, name="host")
app.add_typer(device, name="device")
app.add_typer(user, name="user")

Folder = Annotated[Path, typer.Argument(help="Folder of the site.")]
Days = Annotated[int, typer.Option(min=1, max=3650, help="Validity of certificates, days.")]
UsersFile = Annotated[Path, typer.Argument(help="Users file: the setting http.users of the services.")]


@app.command()
def init(
    folder: Folder,
    *,
    host: Annotated[
        list[str],
        typer.Option(help="Host name or IP address of the broker; repeatable. Clients use the first one."),
    ],
    port: Annotated[int, typer.Option(min=1, max=65535, help="TCP port of the broker.")] = 8883,
    days: Days = 825,
    interface_name: Annotated[
        str, typer.Option(help="Interface name (topic prefix) of robots with VDA 5050 2.x.")
    ] = "uagv",
    interface_name_v3: Annotated[
        str, typer.Option(help="Interface name (topic prefix) of robots with VDA 5050 3.x.")
    ] = "vda5050",
    topic_prefix: Annotated[str, typer.Option(help="Prefix of NeNa's own topics.")] = "nena/v1",
    broker_folder: Annotated[
        str | None,
        typer.Option(
            help="Folder of these files on the broker's machine. Unset: the folder where they are created."
        ),
    ] = None,
    data_folder: Annotated[str, typer.Option(help="Folder for the broker's data.")] = "/var/lib/mosquitto",
    longest_message: Annotated[
        int, typer.Option(min=4, max=255, help="Maximum message size that the broker accepts, MiB.")
    ] = LONGEST_MESSAGE,
) -> None:
    """Create a site: a CA, the broker's certificate and configuration, and the services' identities."""
    topics = SiteTopics(
        interface_name=interface_name, interface_name_v3=interface_name_v3, prefix=topic_prefix
    )
    with errors_reported(), locked(folder):
        Site.new(
            folder,
            hosts=tuple(host),
            port=port,
            topics=topics,
            days=days,
            broker_folder=PurePosixPath(broker_folder) if broker_folder else None,
            data_folder=PurePosixPath(data_folder),
            longest_message=longest_message,
        )
    say(f"Site created in {folder}. Keep {folder}/authority secret: its key can impersonate any client.")
    say(f"Broker: {folder}/broker/mosquitto.conf. Services: {folder}/order-service and status-aggregator.")


@app.command("list")
def list_(folder: Folder) -> None:
    """List identities with the expiry dates of their certificates."""
    with errors_reported():
        site = Site.open(folder)
        table = Table("kind", "name", "valid until", box=None, header_style="bold")
        for each in site:
            table.add_row(
                each.kind, each.name, f"{expiry(site.folder_of(each) / 'certificate.pem'):%Y-%m-%d}"
            )
    Console(soft_wrap=True).print(table)


class ServiceName(StrEnum):
    """Services that serve HTTPS."""

    ORDER_SERVICE = Kind.ORDER_SERVICE
    STATUS_AGGREGATOR = Kind.STATUS_AGGREGATOR


@app.command("https")
def certify_https(
    folder: Folder,
    service: ServiceName,
    *,
    host: Annotated[
        list[str], typer.Option(help="Host name or IP address under which it is reached; repeatable.")
    ],
    days: Days = 825,
) -> None:
    """Create the certificate with which a service serves HTTPS, or replace it."""
    with errors_reported(), locked(folder):
        made = Site.open(folder).certify_https(Kind(service), tuple(host), days=days)
    say(f"Certificate and key of the {service} are in {made}: http.tls_certificate and http.tls_key.")
    say("Clients trust it by ca.pem. The service reads its files at its start. Do not share key.pem.")


@robot.command("add")
def add_robot(folder: Folder, manufacturer: str, serial_number: str, *, days: Days = 825) -> None:
    """Create a robot's identity, or replace its certificate."""
    with errors_reported(), locked(folder):
        _report_created(Site.open(folder).add(Kind.ROBOT, robot_name(manufacturer, serial_number), days=days))


@robot.command("remove")
def remove_robot(folder: Folder, manufacturer: str, serial_number: str) -> None:
    """Clear what the broker retains of a robot, revoke its certificate and delete its identity."""
    with errors_reported(), locked(folder):
        site, name = Site.open(folder), robot_name(manufacturer, serial_number)
        # First: of a robot that this site does not know, nothing may be cleared.
        site.require(Kind.ROBOT, name)
        try:
            # Before remove(), which deletes the rights that clearing needs.
            asyncio.run(site.clear(RobotKey(manufacturer, serial_number)))
        except BrokerError as error:
            say(f"The broker still has retained messages of {name}: it cannot be reached ({error}).")
        site.remove(Kind.ROBOT, name)
    _report_broker_reload()


@host.command("add")
def add_host(folder: Folder, name: str, *, days: Days = 825) -> None:
    """Create a host's identity, or replace its certificate."""
    with errors_reported(), locked(folder):
        _report_created(Site.open(folder).add(Kind.HOST, host_name(name), days=days))


@host.command("remove")
def remove_host(folder: Folder, name: str) -> None:
    """Revoke a host's certificate and delete its identity."""
    with errors_reported(), locked(folder):
        Site.open(folder).remove(Kind.HOST, host_name(name))
    _report_broker_reload()


@device.command("add")
def add_device(folder: Folder, location: str, *, days: Days = 825) -> None:
    """Create the identity of the device at a location, or replace its certificate."""
    with errors_reported(), locked(folder):
        _report_created(Site.open(folder).add(Kind.DEVICE, device_name(location), days=days))


@device.command("remove")
def remove_device(folder: Folder, location: str) -> None:
    """Revoke a device's certificate and delete its identity."""
    with errors_reported(), locked(folder):
        Site.open(folder).remove(Kind.DEVICE, device_name(location))
    _report_broker_reload()


class RoleName(StrEnum):
    """Roles as the command line spells them."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    ADMIN = "admin"


@user.command("add")
def add_user(
    file: UsersFile,
    name: str,
    *,
    role: Annotated[RoleName, typer.Option(help="Role of the user.")],
    group: Annotated[
        str | None,
        typer.Option(help="Group that may read the file (that of the services). Unset: unchanged."),
    ] = None,
) -> None:
    """Add a user, or replace the user's token. The token is shown only once."""
    token = new_token()
    with errors_reported(), locked(file):
        if not NAME.fullmatch(name):
            raise IdentityError(f"Invalid user name {name!r}: use 1 to 64 letters, digits or any of _ . @ -")
        others = [each for each in (read_users(file) if file.exists() else ()) if each.name != name]
        write_users(file, [*others, User(name=name, role=Role[role.name], token_sha256=hash_of(token))])
        if group is not None:
            _set_group(group, file)
    typer.echo(token)


@user.command("remove")
def remove_user(file: UsersFile, name: str) -> None:
    """Remove a user. The token stops working immediately."""
    with errors_reported(), locked(file):
        users = read_users(file)
        if name not in {each.name for each in users}:
            raise IdentityError(f"No user {name} in {file}.")
        write_users(file, [each for each in users if each.name != name])


@user.command("list")
def list_users(file: UsersFile) -> None:
    """List users with their roles."""
    with errors_reported():
        for each in read_users(file):
            typer.echo(f"{each.name}\t{each.role.name.lower()}")


def _set_group(group: str, file: Path) -> None:
    """Make the file readable for its owner and a group only."""
    try:
        shutil.chown(file, group=group)
    except LookupError as error:
        raise IdentityError(f"No group {group}. Create it: groupadd --system {group}") from error
    file.chmod(0o640)


def _report_created(folder: Path) -> None:
    say(f"Copy {folder} to that machine as /etc/nena. Do not share its key.pem.")
    _report_broker_reload()


def _report_broker_reload() -> None:
    say("Copy the site's broker folder to the broker, then reload (kill -HUP) or restart it.")
