"""The commands, called in this process."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from nena_cli.__main__ import app
from nena_demo.plants import sample_plant_path
from nena_order_service.plant_file import load_plant
from nena_plant_formats import files
from nena_plant_formats.files import PlantFormat
from nena_shared.plant import Vehicle
from nena_shared.settings import ConfigurationError
from support.lif_files import edge, lif_of, node
from support.plants import opentcs_xml, path, plant

SAMPLE = str(sample_plant_path())


def nena(*arguments: str, stdin: bytes | None = None, columns: int = 200) -> Result:
    return CliRunner().invoke(app, ["plant", *arguments], input=stdin, env={"COLUMNS": str(columns)})


def codes(found: dict[str, Any]) -> list[str]:
    return [finding["code"] for finding in found["findings"]]


@pytest.fixture
def odd_lif(tmp_path: Path) -> Path:
    """Return a file that is valid LIF except for one field."""
    file = tmp_path / "odd.lif.json"
    file.write_bytes(lif_of(node("A", colour="[red]"), node("B"), edge("A B"), edge("B A")))
    return file


def test_valid_model_is_shown_with_its_contents() -> None:
    done = nena("check", SAMPLE)
    assert done.exit_code == 0
    assert "Sample hall (opentcs)" in done.stdout
    assert "0 errors, " in done.stderr


def test_check_lists_all_errors_and_exits_with_1(tmp_path: Path) -> None:
    file = tmp_path / "plant.xml"
    file.write_bytes(opentcs_xml('<block name="[b]K[/b]" type="QUEUE"><member name="Q"/></block>'))
    done = nena("check", str(file))
    assert done.exit_code == 1
    assert "BAD_VALUE" in done.stdout
    assert "block '[b]K[/b]'" in done.stdout
    assert "2 errors, 0 warnings" in done.stderr


def test_check_shows_the_whole_key_of_a_property(tmp_path: Path) -> None:
    file, key = tmp_path / "plant.xml", "vda5050:destinationAction.Load.parameter.stationType"
    file.write_bytes(opentcs_xml(f'<property name="{key}" value="floor"/>'))
    shown = nena("check", str(file), columns=80).stdout
    rows = [line.split("│")[-2] for line in shown.splitlines() if line.count("│") == 5]
    assert key in "".join(row.strip() for row in rows)


@pytest.mark.parametrize(
    ("properties", "code"),
    [
        ({"vda5050:serialNumber": "a+b"}, "NOT_IN_TOPICS"),
        ({"vda5050:manufacturer": "a/b"}, "NOT_IN_TOPICS"),
        ({"vda5050:interfaceName": "#"}, "NOT_IN_TOPICS"),
        ({"vda5050:topicPrefix": "a/#"}, "NOT_IN_TOPICS"),
        ({"vda5050:serialNumber": "x" * 400}, "NOT_IN_TOPICS"),
        ({"vda5050:version": "1.1"}, "UNKNOWN_VDA5050_VERSION"),
        ({"vda5050:serialNumber": "V0"}, "SAME_SERIAL_NUMBER"),
    ],
)
def test_check_refuses_what_the_order_service_refuses(
    tmp_path: Path, properties: dict[str, str], code: str
) -> None:
    vehicles = (Vehicle(name="V0"), Vehicle(name="V1", properties=properties))
    file = tmp_path / "hall.json"
    file.write_text(plant(path("A B"), path("B A")).model_copy(update={"vehicles": vehicles}).to_json())
    done = nena("check", str(file), "--json")
    found = json.loads(done.stdout)
    assert (done.exit_code, found["usable"]) == (1, False)
    assert [each["code"] for each in found["findings"] if each["severity"] == "error"] == [code]
    with pytest.raises(ConfigurationError, match=code):
        load_plant(file)


def test_check_warns_of_names_that_no_request_can_have(tmp_path: Path) -> None:
    file = tmp_path / "hall.json"
    long = "B" * 201
    file.write_text(plant(path(f"A {long}"), path(f"{long} A")).to_json())
    done = nena("check", str(file), "--json")
    warned = [each for each in json.loads(done.stdout)["findings"] if each["code"] == "LONG_NAME"]
    assert done.exit_code == 0
    assert long in [each["name"] for each in warned]


@pytest.mark.parametrize("data", [b"\xac\xed\x00\x05sr", b"<courseModel/>"])
def test_check_names_files_of_the_old_plant_overview(tmp_path: Path, data: bytes) -> None:
    file = tmp_path / "hall.opentcs"
    file.write_bytes(data)
    done = nena("check", str(file), "--json")
    (finding,) = json.loads(done.stdout)["findings"]
    assert (done.exit_code, finding["code"]) == (1, "OLD_OPENTCS_FORMAT")
    assert "openTCS 4" in finding["text"]


@pytest.mark.parametrize("command", [("check",), ("import", "-o"), ("convert", "--format", "lif", "-o")])
@pytest.mark.parametrize(
    ("data", "name"),
    [
        (b'{"type": "FeatureCollection", "name": "hall", "features": []}', "GeoJSON"),
        (b"image: hall.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n", "map_server"),
        (b"P5 2 2 255\n\0\0\0\0", "image"),
    ],
)
def test_file_that_is_no_plant_model_is_named(
    tmp_path: Path, command: tuple[str, ...], data: bytes, name: str
) -> None:
    file, out = tmp_path / "hall", tmp_path / "out"
    file.write_bytes(data)
    written = [str(out)] if command[-1] == "-o" else []
    done = nena(command[0], str(file), *command[1:], *written, "--json")
    (finding,) = json.loads(done.stdout)["findings"]
    assert (done.exit_code, finding["code"], out.exists()) == (1, "NOT_A_PLANT_MODEL", False)
    assert name in finding["text"]
    with pytest.raises(ConfigurationError, match=name):
        load_plant(file)


def test_import_loses_nothing(tmp_path: Path) -> None:
    out = tmp_path / "hall.json"
    done = nena("import", SAMPLE, "-o", str(out))
    assert done.exit_code == 0, done.stderr
    assert files.format_of(out.read_bytes()) is PlantFormat.NENA
    assert files.read(out.read_bytes()).model == files.read(sample_plant_path().read_bytes()).model
    assert f"{out} written" in done.stderr.replace("\n", "")


@pytest.mark.parametrize("kind", ["lif", "lif-2.0", "opentcs", "nena"])
def test_lif_and_own_json_are_converted(kind: str, odd_lif: Path, tmp_path: Path) -> None:
    own, out = tmp_path / "own.json", tmp_path / "out"
    assert nena("import", str(odd_lif), "-o", str(own)).exit_code == 0
    done = nena("convert", str(own), "--format", kind, "-o", str(out), "--json")
    assert done.exit_code == 0
    found = json.loads(done.stdout)
    assert found["written"] == str(out)
    assert ("NOT_EXPORTED" in codes(found)) is (kind in ("opentcs", "lif-2.0"))
    assert files.format_of(out.read_bytes()) == kind.removesuffix("-2.0")
    assert set(files.read(out.read_bytes()).model.paths_by_name) == {"A-B", "B-A"}


@pytest.mark.parametrize(
    "command", [("import",), ("export", "--format", "lif"), ("convert", "--format", "lif-2.0")]
)
def test_a_model_with_errors_is_not_written(command: tuple[str, ...], tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = nena(*command, "-", "-o", str(out), stdin=b"<model/>")
    assert done.exit_code == 1
    assert "UNSUPPORTED_VERSION" in done.stderr
    assert not out.exists()


def test_existing_file_is_kept_unless_replaced_explicitly(tmp_path: Path) -> None:
    out = tmp_path / "out.json"
    out.write_text("mine")
    done = nena("import", SAMPLE, "-o", str(out))
    assert (done.exit_code, out.read_text()) == (2, "mine")
    assert "--replace" in done.stderr
    assert nena("import", SAMPLE, "-o", str(out), "--replace").exit_code == 0
    assert out.read_text() != "mine"


def test_a_route_graph_is_exported_for_nav2(tmp_path: Path) -> None:
    out = tmp_path / "hall.geojson"
    done = nena("convert", SAMPLE, "--nav2-route", "-o", str(out), "--map", "hall", "--json")
    assert done.exit_code == 0
    graph = json.loads(out.read_text())
    names = {each["properties"]["metadata"]["name"] for each in graph["features"]}
    model = files.read(Path(SAMPLE).read_bytes()).model
    assert set(model.points_by_name) <= names
