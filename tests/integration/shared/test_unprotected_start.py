"""A service that would listen beyond loopback without TLS or a login does not start, and reports why."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from nena_demo.plants import sample_plant_path
from support.waiting import PATIENCE

SERVICES = {
    "nena-order-service": ["nena_order_service", "--plant", str(sample_plant_path())],
    "nena-status-aggregator": ["nena_status_aggregator"],
}
WITHOUT_TLS = "setting http.host: 0.0.0.0 is reachable from other machines, without TLS."
WITHOUT_A_LOGIN = "setting http.host: 0.0.0.0 is reachable from other machines, without a login."


@pytest.mark.parametrize("service", SERVICES)
@pytest.mark.parametrize(
    ("options", "complaints"),
    [
        ((), (WITHOUT_TLS, WITHOUT_A_LOGIN)),
        (("--http.reverse_proxy",), (WITHOUT_A_LOGIN,)),
        (("--http.users", "users.toml"), (WITHOUT_TLS,)),
    ],
)
def test_exits_with_status_2_and_a_line_per_missing_protection(
    tmp_path: Path, service: str, options: tuple[str, ...], complaints: tuple[str, ...]
) -> None:
    command = [sys.executable, "-m", *SERVICES[service], "--http.host", "0.0.0.0", "--http.port", "0"]
    (tmp_path / "users.toml").touch()

    done = subprocess.run(
        [*command, *options], cwd=tmp_path, capture_output=True, text=True, timeout=PATIENCE, check=False
    )

    assert done.returncode == 2, done.stderr
    said = [line for line in done.stderr.splitlines() if line.startswith(f"{service}: ")]
    assert len(said) == len(complaints), done.stderr
    for line, complaint in zip(said, complaints, strict=True):
        assert line.startswith(f"{service}: {complaint}")
    assert "Traceback" not in done.stderr
