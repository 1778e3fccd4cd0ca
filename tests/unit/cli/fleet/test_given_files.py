"""Files that people give to commands; what is no file of its kind is told in a line, and nothing is sent."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from nena_cli.fleet import orders, zones


@pytest.mark.parametrize(
    "content", [b"\xff", b"{", b'{"destinations": [{"locationName": "\xff"}]}', b"[" * 100_000]
)
def test_an_order_that_is_none(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "order.json"
    file.write_bytes(content)
    done = CliRunner().invoke(orders.app, ["create", "--file", str(file)])

    assert (done.exit_code, type(done.exception)) == (2, SystemExit)
    assert "message: Invalid JSON" in done.stderr


@pytest.mark.parametrize("content", [b"\xff", b"{", b'{"mapId": NaN}', b"[" * 100_000])
def test_a_zone_set_that_is_none(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "zones.json"
    file.write_bytes(content)
    done = CliRunner().invoke(zones.app, ["put", str(file)])

    assert (done.exit_code, type(done.exception)) == (2, SystemExit)
    assert done.stderr.startswith(f"nena: {file}: ")
