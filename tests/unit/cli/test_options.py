from __future__ import annotations

from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from nena_cli.options import DEFAULT_URL, Format, group
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


def test_defaults() -> None:
    assert given("fleet", "list") == Service([DEFAULT_URL], None, None, Format.TABLE)


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


def test_token_file_before_the_command(tmp_path: Path) -> None:
    file = tmp_path / "token"
    assert given("--token-file", str(file), "fleet", "list").token_file == file


def test_only_the_command_shows_the_options_of_the_service() -> None:
    assert isinstance(app, typer.Typer)
    environment = {"COLUMNS": "200"}
    assert "--url" not in CliRunner().invoke(app, ["fleet", "--help"], env=environment).stdout
    assert "--url" in CliRunner().invoke(app, ["fleet", "list", "--help"], env=environment).stdout
