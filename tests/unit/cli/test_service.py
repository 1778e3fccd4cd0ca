"""The options that name an order service, and what becomes of what goes wrong there."""

from __future__ import annotations

from pathlib import Path

import pytest
import typer

from nena_cli.options import DEFAULT_URL, Format
from nena_cli.service import Service
from nena_client import RefusedError, UnreachableError
from nena_shared.fleet_api.transport_order import Problem


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


def test_token_file_that_cannot_be_read_is_named(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    with pytest.raises(typer.Exit), service(token_file=tmp_path / "missing").connected():
        pass
    told = capsys.readouterr().err
    assert f"Cannot read the token file {tmp_path / 'missing'}" in told.replace("\n", "")
    assert "connect" not in told


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
