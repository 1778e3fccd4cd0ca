"""Options that select the order service and the output format; light enough for every start."""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum
from inspect import Parameter, Signature
from pathlib import Path
from typing import Annotated, Any, Final

import typer

DEFAULT_URL: Final = "http://127.0.0.1:55200"


class Format(StrEnum):
    """Format of what a command prints."""

    TABLE = "table"
    """A table that fits the terminal; into a pipe, rows of values separated by tabs, without a header."""
    WIDE = "wide"
    """A table with a header and without line breaks in its rows, also into a pipe."""
    JSON = "json"
    """A line of JSON per object, as in the REST API."""
    YAML = "yaml"
    """A YAML document per object."""
    NAME = "name"
    """The name of each object."""


PLAIN: Final = None
"""Typer's markup mode of all commands: help and usage errors in plain text, which starts without Rich."""


def _shared_options(*, hidden: bool) -> tuple[Parameter, ...]:
    """Return the options as parameters of a Typer command."""

    def described(*names: str, **more: Any) -> Any:  # noqa: ANN401 - Typer's own type
        return typer.Option(*names, hidden=hidden, **more)

    url = described(
        "--url",
        envvar="NENA_URL",
        metavar="URL",
        help=f"URL of the order service; repeatable for a standby. Unset: {DEFAULT_URL}.",
    )
    token = described(
        "--token", envvar="NENA_TOKEN", metavar="TEXT", help="Access token; prefer the environment variable."
    )
    file = described("--token-file", metavar="FILE", help="File that contains the token.")
    output = described(
        "--output",
        "-o",
        metavar="|".join(Format),
        help="Output format; into a pipe, table prints values between tabs.",
    )
    return tuple(
        Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, each])
        for name, kind, default, each in (
            ("url", list[str] | None, None, url),
            ("token", str | None, None, token),
            ("token_file", Path | None, None, file),
            ("output", Format, Format.TABLE, output),
            ("as_json", bool, False, described("--json", help="Same as -o json.")),
        )
    )


OPTIONS: Final = _shared_options(hidden=False)


def group(*more: Parameter, hidden: bool = True, **settings: Any) -> typer.Typer:  # noqa: ANN401 - of Typer
    """Return a group of commands that takes the options also before a command's name.

    ``more`` are further options of the group, handled by their own callbacks. The help of the group shows
    the options unless they are ``hidden``.
    """

    def callback(**_: Any) -> None:  # noqa: ANN401 - the command reads them from its context
        return

    options = (*_shared_options(hidden=hidden), *more)
    callback.__signature__ = Signature(options)  # type: ignore[attr-defined]
    callback.__annotations__ = {each.name: each.annotation for each in options}
    return typer.Typer(
        no_args_is_help=True,
        callback=callback,
        add_completion=not hidden,
        rich_markup_mode=PLAIN,
        **settings,
    )


def option(context: typer.Context, name: str) -> Any:  # noqa: ANN401 - of any type
    """Return an option's value: from the command line, that nearest to the command, or the default."""
    given = next(_contexts_with_options(context, name), None)
    return context.params.get(name) if given is None else given.params[name]


def output_of(context: typer.Context) -> Format:
    """Return the output format: that nearest to the command; ``--json`` is one of its spellings."""
    for at in _contexts_with_options(context, "as_json", "output"):
        return Format.JSON if at.params["as_json"] else at.params["output"]
    return Format.TABLE


def own_options(context: typer.Context) -> tuple[str, ...]:
    """Return the command's own options on the command line, in the order of its help."""
    shared = {each.name for each in OPTIONS}
    own = (param for param in context.command.params if param.name not in shared and param.opts[0][0] == "-")
    return tuple(each.opts[0] for each in own if _is_given(context, each.name))


def _contexts_with_options(context: typer.Context, *names: str) -> Iterator[Any]:
    """Yield the contexts, innermost first, that have one of these options from the command line."""
    at: Any = context
    while at is not None:
        if any(_is_given(at, name) for name in names):
            yield at
        at = at.parent


def _is_given(context: Any, name: str | None) -> bool:  # noqa: ANN401 - Typer's own copy of click has no types
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"
