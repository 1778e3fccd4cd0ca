"""The commands as a user calls them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from nena_demo.plants import sample_plant_path
from nena_plant_formats.files import read
from support.drawn_maps import hall, office, write_map
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


def test_plant_is_proposed_from_a_map_and_checked(tmp_path: Path) -> None:
    robots = ("--robot-width", "0.6", "--robot-length", "0.8", "--robot", "ACME/amr-01")
    out, source = tmp_path / "site.json", write_map(tmp_path, office())
    done = nena("new", "--map", str(source), *robots, "-o", str(out))
    assert done.returncode == 0, done.stderr
    assert b"parking positions" in done.stderr
    assert b"Parking 1: x " in done.stderr
    (vehicle,) = read(out.read_bytes()).model.vehicles
    assert (vehicle.manufacturer, vehicle.serial_number) == ("ACME", "amr-01")
    assert nena("check", str(out)).returncode == 0

    again = nena("new", "--map", str(source), *robots, "-o", str(out))
    assert (again.returncode, b"--replace overwrites it" in again.stderr) == (2, True)
    narrow = nena("new", "--map", str(write_map(tmp_path, hall(5, 0.5))), *robots, "-o", str(out))
    assert (narrow.returncode, b"No place of map 'site' has room" in narrow.stderr) == (2, True)
    wrong = nena("new", "--map", str(source), *robots, "--robot", "amr-02", "-o", str(out))
    assert (wrong.returncode, b"use MANUFACTURER/SERIAL" in wrong.stderr) == (2, True)
