"""``nena vda5050 test``: what it refuses before it connects."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from nena_cli import conversations
from nena_cli.conversations import app
from nena_conversations.kit.clause import NotApplicableError

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


@pytest.mark.parametrize(
    "side", [["robot", BROKER, "ACME/1", "--version", "2.1.0"], ["fleet", BROKER, "ACME/1"]]
)
def test_a_report_that_cannot_be_written_is_said_before_the_test(side: list[str], tmp_path: Path) -> None:
    existing = tmp_path / "messages.jsonl"
    existing.write_text("kept")
    for option, path in (
        ("--html", tmp_path / "missing" / "report.html"),
        ("--junit", tmp_path),
        ("--recording", existing),
    ):
        result = CliRunner().invoke(app, ["test", *side, option, str(path)])
        assert result.exit_code == 2
        assert "choose another name" in result.output.replace("\n", " ")


async def test_a_step_at_the_robot_can_be_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("typer.prompt", lambda *_, **__: "s")
    with pytest.raises(NotApplicableError, match="skipped: press the button"):
        await conversations._ask_at_the_robot("press the button")
