"""The commands as a user calls them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from nena_demo.plants import sample_plant_path
from nena_plant_formats.files import read
from support.waiting import PATIENCE


def nena(*arguments: str, stdin: bytes = b"") -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-m", "nena_cli", "plant", *arguments]
    return subprocess.run(command, capture_output=True, input=stdin, timeout=PATIENCE, check=False)


def test_plant_is_converted_in_a_pipe(tmp_path: Path) -> None:
    own = nena("import", str(sample_plant_path()), "-o", "-")
    assert own.returncode == 0, own.stderr
    out = tmp_path / "hall.xml"
    done = nena("export", "-", "--format", "opentcs", "-o", str(out), stdin=own.stdout)
    assert done.returncode == 0, done.stderr
    assert read(out.read_bytes()).model == read(sample_plant_path().read_bytes()).model
    assert nena("check", str(out)).returncode == 0
