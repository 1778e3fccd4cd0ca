"""The options that name an order service, and what becomes of what goes wrong there."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from nena_cli.options import DEFAULT_URL, Format
from nena_cli.service import Service, of_service
from nena_cli.styled import Table
from nena_client import RefusedError, UnreachableError
from nena_shared.fleet_api.transport_order import Problem

app = typer.Typer()
seen: list[tuple[Service, str, int]] = []


@app.command()
@of_service
def echo(
    service: Service, word: str, *, times: Annotated[int, typer.Option("--times", help="How often.")] = 1
) -> None:
    """Say a word."""
    seen.append((service, word, times))


def called(*arguments: str) -> tuple[Service, str, int]:
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    return seen.pop()


def test_command_has_its_own_options_and_the_service_options() -> None:
    service, word, times = called("hello", "--times", "3", "--url", "http://a", "--url", "http://b", "--json")

    assert (word, times) == ("hello", 3)
    assert (service.urls, service.output) == (["http://a", "http://b"], Format.JSON)


def test_without_options_it_is_the_one_on_this_machine() -> None:
    service, _, times = called("hello")

    assert (service.urls, service.token, service.output, times) == ([DEFAULT_URL], None, Format.TABLE, 1)


def test_the_environment_names_it_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NENA_URL", "http://c")
    monkeypatch.setenv("NENA_TOKEN", "secret")

    service, _, _ = called("hello")

    assert (service.urls, service.token) == (["http://c"], "secret")


def test_help_lists_all_options_and_describes_the_command() -> None:
    told = CliRunner().invoke(app, ["--help"], env={"COLUMNS": "200"}).stdout
    for each in ("Say a word.", "--times", "--url", "--token-file", "--json", "How often."):
        assert each in told


def service(**fields: object) -> Service:
    given = {"urls": [DEFAULT_URL], "token": None, "token_file": None, "output": Format.TABLE, **fields}
    return Service(**given)  # type: ignore[arg-type] # any of its fields


def test_token_is_read_from_a_file(tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.write_text("from the file\n")
    with service(token="of the option", token_file=file).connected() as connection:
        assert connection._client.headers["authorization"] == "Bearer from the file"


@pytest.mark.parametrize(
    ("error", "status", "words"),
    [
        (RefusedError(Problem(title="No", status=409, detail="It has ended.")), 1, "nena: It has ended."),
        (UnreachableError("away"), 2, "Cannot connect to the order service"),
        (FileNotFoundError("no token"), 2, "no token"),
        (KeyboardInterrupt(), 0, ""),
    ],
)
def test_error_is_one_line_and_a_status(
    capsys: pytest.CaptureFixture[str], error: BaseException, status: int, words: str
) -> None:
    with pytest.raises(typer.Exit) as caught, service().connected():
        raise error
    assert caught.value.exit_code == status
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("token", "words"), [(None, "Set NENA_TOKEN or --token-file"), ("x", "Unknown token.")]
)
def test_missing_token_is_reported_with_the_options_for_it(
    capsys: pytest.CaptureFixture[str], token: str | None, words: str
) -> None:
    with pytest.raises(typer.Exit) as caught, service(token=token).connected():
        raise RefusedError(Problem(title="Unauthorized", status=401, detail="Unknown token."))
    assert caught.value.exit_code == 1
    assert words in capsys.readouterr().err


def test_people_get_tables_and_scripts_a_line_for_each(capsys: pytest.CaptureFixture[str]) -> None:
    problems = [Problem(title="A", status=404, detail="a"), Problem(title="B", status=409, detail="b")]

    def table(found: Sequence[Problem]) -> Table:
        made = Table("title")
        for each in found:
            made.add_row(each.title)
        return made

    service().print_all(problems, table)
    shown = capsys.readouterr().out
    assert "A" in shown
    assert "{" not in shown
    service(output=Format.JSON).print_all(problems, table)
    service(output=Format.JSON).print_one(problems[0], Table(title="one"))
    told = [json.loads(line)["detail"] for line in capsys.readouterr().out.splitlines()]
    assert told == ["a", "b", "a"]
