"""``nena vda5050 test``: what it refuses before it connects."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from nena_cli.conversations import app

BROKER = "mqtt://127.0.0.1:1"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["amr-01"], "'amr-01' is no robot: use MANUFACTURER/SERIAL"),
        (["ACME/amr-01@9.0"], "VDA 5050 '9.0' is not supported"),
        (["ACME/amr-01:here"], "'here' is no place: use X,Y in m"),
        ([f"ACME/amr-{number}" for number in range(11)], "11 robots are too many: at most 10"),
        (["ACME/amr-01", "--clause", "order/nope"], "There is no clause order/nope; there are order/start,"),
        (["ACME/amr-01@2.1:1,2"], "Cannot connect to the broker"),
    ],
)
def test_what_cannot_be_tested_is_said(arguments: list[str], words: str) -> None:
    result = CliRunner().invoke(app, ["test", "fleet", BROKER, *arguments])

    assert result.exit_code == 2
    assert words in result.output.replace("\n", " ")
