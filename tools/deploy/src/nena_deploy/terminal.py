"""What the person at the terminal is told; standard output belongs to the results."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import typer

from nena_deploy.alone import BusyError
from nena_deploy.identity import IdentityError
from nena_deploy.site import SiteError
from nena_shared.settings import ConfigurationError

WRONG = 2
"""Exit status of a command that could not do its work."""


def say(text: str) -> None:
    """Tell something that is no result."""
    typer.echo(text, err=True)


@contextmanager
def faults_told() -> Iterator[None]:
    """End with one clear line where the work cannot be done."""
    try:
        yield
    except (SiteError, BusyError, IdentityError, ConfigurationError, OSError) as error:
        say(f"nena-deploy: {error}")
        raise typer.Exit(WRONG) from error
