"""``nena-deploy``: the commands for a site's authority, identities and users."""

from __future__ import annotations

from pathlib import Path, PurePosixPath
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from nena_deploy import user_commands
from nena_deploy.alone import alone
from nena_deploy.authority import expiry
from nena_deploy.identity import Kind, host_name, robot_name
from nena_deploy.site import Site
from nena_deploy.terminal import faults_told, say
from nena_deploy.topics import SiteTopics

app = typer.Typer(help="What a NeNa site needs to be safe.", no_args_is_help=True, add_completion=False)
robot = typer.Typer(help="Robots: each has an identity of its own at the broker.", no_args_is_help=True)
host = typer.Typer(help="Hosts (WMS, MES): each asks for orders under its own name.", no_args_is_help=True)
app.add_typer(robot, name="robot")
app.add_typer(host, name="host")
app.add_typer(user_commands.app, name="user")

Folder = Annotated[Path, typer.Argument(help="The site's folder.")]
Days = Annotated[int, typer.Option(min=1, max=3650, help="How long certificates are good.")]


@app.command()
def init(
    folder: Folder,
    *,
    host: Annotated[
        list[str], typer.Option(help="Name or address of the broker; the first one is what clients use.")
    ],
    port: Annotated[int, typer.Option(min=1, max=65535, help="The broker's TCP port.")] = 8883,
    days: Days = 825,
    interface_name: Annotated[str, typer.Option(help="First levels of VDA 5050 2.x topics.")] = "uagv",
    interface_name_v3: Annotated[str, typer.Option(help="First levels of VDA 5050 3.x topics.")] = "vda5050",
    topic_prefix: Annotated[
        str, typer.Option(help="First levels of the order service's topics.")
    ] = "nena/v1",
    broker_folder: Annotated[
        str | None, typer.Option(help="Where the broker will find its files; by default where they are made.")
    ] = None,
    data_folder: Annotated[str, typer.Option(help="Where the broker keeps its data.")] = "/var/lib/mosquitto",
) -> None:
    """Make a site: an authority, the broker's certificate and configuration, identities of the services."""
    topics = SiteTopics(
        interface_name=interface_name, interface_name_v3=interface_name_v3, prefix=topic_prefix
    )
    with faults_told(), alone(folder):
        Site.new(
            folder,
            hosts=tuple(host),
            port=port,
            topics=topics,
            days=days,
            broker_folder=PurePosixPath(broker_folder) if broker_folder else None,
            data_folder=PurePosixPath(data_folder),
        )
    say(f"The site is in {folder}. Keep {folder}/authority safe: who has it can be anybody.")
    say(f"Broker: {folder}/broker/mosquitto.conf. Services: order-service and status-aggregator there.")


@app.command("list")
def list_(folder: Folder) -> None:
    """Show who has an identity, and until when its certificate is good."""
    with faults_told():
        site = Site.open(folder)
        table = Table("kind", "name", "good until", box=None, header_style="bold")
        for each in site:
            table.add_row(
                each.kind, each.name, f"{expiry(site.folder_of(each) / 'certificate.pem'):%Y-%m-%d}"
            )
    Console(soft_wrap=True).print(table)


@robot.command("add")
def add_robot(folder: Folder, manufacturer: str, serial_number: str, *, days: Days = 825) -> None:
    """Give a robot an identity, or a new certificate in the place of its old one."""
    with faults_told(), alone(folder):
        _added(Site.open(folder).add(Kind.ROBOT, robot_name(manufacturer, serial_number), days=days))


@robot.command("remove")
def remove_robot(folder: Folder, manufacturer: str, serial_number: str) -> None:
    """Take a robot's identity back."""
    with faults_told(), alone(folder):
        Site.open(folder).remove(Kind.ROBOT, robot_name(manufacturer, serial_number))
    _tell_broker()


@host.command("add")
def add_host(folder: Folder, name: str, *, days: Days = 825) -> None:
    """Give a host an identity, or a new certificate in the place of its old one."""
    with faults_told(), alone(folder):
        _added(Site.open(folder).add(Kind.HOST, host_name(name), days=days))


@host.command("remove")
def remove_host(folder: Folder, name: str) -> None:
    """Take a host's identity back."""
    with faults_told(), alone(folder):
        Site.open(folder).remove(Kind.HOST, host_name(name))
    _tell_broker()


def _added(folder: Path) -> None:
    say(f"Bring {folder} there as /etc/nena; its key.pem is for that one alone.")
    _tell_broker()


def _tell_broker() -> None:
    say("Bring the site's broker folder to the broker, and have it read anew: kill -HUP, or restart it.")
