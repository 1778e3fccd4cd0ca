"""The status aggregator of a command: its address, and its answers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Final

import httpx
import typer
from pydantic import ValidationError

from nena_cli.output import REFUSED, fail
from nena_cli.service import Service
from nena_cli.tables import printable

DEFAULT_AGGREGATOR: Final = "http://127.0.0.1:8080"
TIMEOUT: Final = 30.0
"""Timeout of each step of a request, seconds."""

Aggregator = Annotated[
    str,
    typer.Option(
        "--aggregator", envvar="NENA_AGGREGATOR_URL", metavar="URL", help="URL of the status aggregator."
    ),
]


@contextmanager
def connect_aggregator(service: Service, url: str) -> Iterator[httpx.Client]:
    """Connect to the status aggregator; report an error in one line and exit."""
    with service.reporting("status aggregator", "--aggregator or NENA_AGGREGATOR_URL"):
        token = service.access_token()
        headers = {"authorization": f"Bearer {token}"} if token else {}
        try:
            with httpx.Client(base_url=url, headers=headers, timeout=TIMEOUT) as client:
                yield client
        except ValidationError:
            fail(f"{url} is not a status aggregator. Set --aggregator or NENA_AGGREGATOR_URL.")


def check_answer(answer: httpx.Response, status: int = REFUSED) -> None:
    """Report a refusal and exit with ``status``."""
    if answer.is_success:
        return
    try:
        detail = str(answer.json()["detail"])
    except (ValueError, KeyError, TypeError):
        detail = f"{answer.url} answered {answer.status_code}; is it a status aggregator?"
    fail(printable(detail), status)
