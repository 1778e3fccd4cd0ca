from __future__ import annotations

import pytest
from typer.testing import CliRunner

from nena_cli.options import Format, group
from nena_cli.service import Service, of_service

seen: list[Service] = []
app = group()
fleet = group()
app.add_typer(fleet, name="fleet")


@fleet.command("list")
@of_service
def list_(service: Service) -> None:
    """Keep the service for the test."""
    seen.append(service)


@fleet.command("other")
def other() -> None:
    """Do nothing; a group needs two commands."""


def given(*arguments: str) -> Service:
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    return seen.pop()


@pytest.mark.parametrize(
    "arguments",
    [
        ("--url", "http://a", "fleet", "list"),
        ("fleet", "--url", "http://a", "list"),
        ("fleet", "list", "--url", "http://a"),
        ("--url", "http://b", "fleet", "list", "--url", "http://a"),
    ],
)
def test_options_may_stand_at_any_place_and_the_innermost_wins(arguments: tuple[str, ...]) -> None:
    assert given(*arguments).urls == ["http://a"]


def test_an_option_before_the_command_wins_over_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NENA_URL", "http://environment")

    assert given("fleet", "list").urls == ["http://environment"]
    assert given("--url", "http://a", "fleet", "list").urls == ["http://a"]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("-o", "yaml", "fleet", "list"), Format.YAML),
        (("fleet", "list", "--json"), Format.JSON),
        (("--json", "fleet", "list", "-o", "yaml"), Format.YAML),
        (("-o", "yaml", "fleet", "list", "--json"), Format.JSON),
        (("fleet", "list", "--output", "name"), Format.NAME),
    ],
)
def test_output_formats(arguments: tuple[str, ...], expected: Format) -> None:
    assert given(*arguments).output is expected
