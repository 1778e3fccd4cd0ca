from __future__ import annotations

from pathlib import Path

import pytest

from nena_demo.plants import sample_plant_path
from nena_order_service.plant_file import load_plant
from nena_shared.settings import ConfigurationError
from support.lif_files import edge, lif_of, node
from support.plants import opentcs_xml


def vehicle(name: str, serial: str) -> str:
    return (
        f'<vehicle name="{name}" energyLevelCritical="1" energyLevelGood="2" energyLevelFullyRecharged="2" '
        'energyLevelSufficientlyRecharged="1" maxVelocity="1" maxReverseVelocity="1">'
        '<boundingBox length="1" width="1" height="1" referenceOffsetX="0" referenceOffsetY="0"/>'
        f'<property name="vda5050:serialNumber" value="{serial}"/></vehicle>'
    )


def problems(path: Path) -> str:
    with pytest.raises(ConfigurationError) as caught:
        load_plant(path)
    assert all(problem.startswith("plant: ") for problem in caught.value.problems)
    return "\n".join(caught.value.problems)


def test_sample_plant_is_read() -> None:
    assert load_plant(sample_plant_path()).model.name == "Sample hall"


def test_missing_file_is_named(tmp_path: Path) -> None:
    assert "nowhere.xml: No such file" in problems(tmp_path / "nowhere.xml")


def test_folder_and_other_files_are_refused(tmp_path: Path) -> None:
    assert "directory" in problems(tmp_path)
    letter = tmp_path / "letter.txt"
    letter.write_text("Dear all")
    assert str(letter) in problems(letter)


def test_every_problem_of_a_plant_is_a_line(tmp_path: Path) -> None:
    file = tmp_path / "plant.xml"
    body = (
        '<path name="p" sourcePoint="A" destinationPoint="B" length="1" '
        'maxVelocity="1" maxReverseVelocity="0" locked="false"/>'
    )
    file.write_bytes(opentcs_xml(body))
    assert len(problems(file).splitlines()) == 2


def test_robots_need_separate_topics(tmp_path: Path) -> None:
    file = tmp_path / "plant.xml"
    file.write_bytes(opentcs_xml(vehicle("V1", "s") + vehicle("V2", "s") + vehicle("V3", "a/b")))
    found = problems(file)
    assert "'V1' and 'V2' have the same serial number 's'" in found
    assert "serial number 'a/b' must not contain '/', '+' or '#'" in found


def test_a_plant_without_points_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "plant.xml"
    file.write_text('<model version="6.0.0" name="empty"/>')
    assert "model 'empty': has no points" in problems(file)


def test_lif_and_own_json_are_read_too(tmp_path: Path) -> None:
    layout = tmp_path / "hall.lif.json"
    layout.write_bytes(lif_of(node("A"), node("B"), edge("A B")))
    plant = load_plant(layout).model
    assert [path.name for path in plant.paths] == ["A-B"]
    own = tmp_path / "hall.json"
    own.write_text(plant.to_json())
    assert load_plant(own).model == plant


def test_digest_is_that_of_the_bytes(tmp_path: Path) -> None:
    file = tmp_path / "plant.json"
    file.write_text(load_plant(sample_plant_path()).model.to_json())
    before = load_plant(file)
    assert load_plant(file).digest == before.digest
    file.write_text(file.read_text() + "\n")
    assert load_plant(file).digest != before.digest
