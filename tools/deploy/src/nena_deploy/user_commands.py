"""``nena-deploy user``: who may log in to the panel and the REST door."""

from __future__ import annotations

import shutil
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from nena_deploy.alone import alone
from nena_deploy.identity import IdentityError
from nena_deploy.terminal import faults_told
from nena_shared.web.users import NAME, Role, User, hash_of, new_token, read_users, write_users

app = typer.Typer(help="Users of panel and REST door.", no_args_is_help=True)

File = Annotated[Path, typer.Argument(help="The file that http.users names.")]


class RoleName(StrEnum):
    """Roles as one writes them."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    ADMIN = "admin"


@app.command("add")
def add(
    file: File,
    name: str,
    *,
    role: Annotated[RoleName, typer.Option(help="What the user may do.")],
    group: Annotated[
        str | None, typer.Option(help="Group of the services' users, which reads the file; stays as it was.")
    ] = None,
) -> None:
    """Let somebody in, or give a new token in the place of the old one; the token is shown this once."""
    token = new_token()
    with faults_told(), alone(file):
        if not NAME.fullmatch(name):
            message = f"{name!r} is no name: 1 to 64 letters, digits or signs of _ . @ -"
            raise IdentityError(message)
        others = [each for each in (read_users(file) if file.exists() else ()) if each.name != name]
        write_users(file, [*others, User(name=name, role=Role[role.name], token_sha256=hash_of(token))])
        if group is not None:
            _give_to(group, file)
    typer.echo(token)


@app.command("remove")
def remove(file: File, name: str) -> None:
    """Let somebody in no more, from this moment on."""
    with faults_told(), alone(file):
        users = read_users(file)
        if name not in {each.name for each in users}:
            message = f"There is no user {name} in {file}."
            raise IdentityError(message)
        write_users(file, [each for each in users if each.name != name])


@app.command("list")
def list_(file: File) -> None:
    """Show who may do what."""
    with faults_told():
        for user in read_users(file):
            typer.echo(f"{user.name}\t{user.role.name.lower()}")


def _give_to(group: str, file: Path) -> None:
    """Let a group read the file, and nobody else but its owner."""
    try:
        shutil.chown(file, group=group)
    except LookupError as error:
        message = f"There is no group {group}. Make it: groupadd --system {group}"
        raise IdentityError(message) from error
    file.chmod(0o640)
