"""Plants in the style of public openTCS models: orders finish, whatever the operations are called."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from xml.sax.saxutils import quoteattr

import pytest
from typer.testing import CliRunner

from nena_plant_formats.files import read
from nena_shared.fleet_api.transport_order import Destination, TransportOrderRequest
from nena_shared.plant import PlantModel
from nena_simulate.command import app
from nena_simulate.demand import Demand, Order
from nena_simulate.report import Figures, Report
from nena_simulate.simulation import simulate
from nena_simulate.site import Case

Ends = Iterable[tuple[int, int]]


def two_way(*ends: tuple[int, int]) -> Ends:
    return [*ends, *((end, start) for start, end in ends)]


LINE = two_way((0, 1), (1, 2), (2, 3))
TREE = two_way((0, 1), (1, 2), (1, 3), (0, 4), (4, 5))
RING = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 0)]
LOOP = two_way(*RING)
"""Pairs of points; the points lie on a grid, 4 m apart."""


def written(
    ends: Ends,
    types: dict[str, str],
    places: dict[str, tuple[str, int]],
    *,
    vehicles: str = '<vehicle name="V1"/>',
    names: str = "Point-{:04}",
    properties: str = "",
    locked: Iterable[tuple[int, int]] = (),
) -> str:
    """Return openTCS XML: ``types`` have operations, separated by commas; places a type and a point."""
    name = [quoteattr(names.format(number)) for number in range(6)]
    used = sorted({point for pair in ends for point in pair})
    text = "".join(
        f'<point name={name[at]} xPosition="{at % 3 * 4000}" yPosition="{at // 3 * 4000}" zPosition="0" '
        f'vehicleOrientationAngle="NaN" type="HALT_POSITION"/>'
        for at in used
    )
    text += "".join(
        f'<path name="{a} --- {b}" sourcePoint={name[a]} destinationPoint={name[b]} length="4000" '
        f'maxVelocity="1000" maxReverseVelocity="0" locked="{str((a, b) in locked).lower()}"/>'
        for a, b in ends
    )
    text += vehicles
    for kind, operations in types.items():
        allowed = (
            f"<allowedOperation name={quoteattr(each)}/>" for each in filter(None, operations.split(","))
        )
        text += f"<locationType name={quoteattr(kind)}>{''.join(allowed)}{properties}</locationType>"
    for place, (kind, at) in places.items():
        text += (
            f'<location name={quoteattr(place)} xPosition="{at % 3 * 4000}" yPosition="9000" zPosition="0" '
            f'type={quoteattr(kind)} locked="false"><link point={name[at]}/></location>'
        )
    return f'<?xml version="1.0" encoding="UTF-8"?><model version="0.0.4" name="site">{text}</model>'


def model_of(text: str) -> PlantModel:
    return read(text.encode()).model


def run(text: str, *, robots: int = 1) -> Figures:
    case = Case(model_of(text), Demand(backlog=robots), robots, hours=0.03, speed=3.0, work_seconds=1.0)
    return simulate(case)


M = {"M1": ("Machine", 0), "M2": ("Machine", 3)}
CHARGER = {"C1": ("Charger", 2)}
OWN_ACTION = (
    '<property name="vda5050:destinationAction.Load cargo.parameter.height" value="integer:2"/>'
    '<property name="vda5050:destinationAction.Load cargo.blockingType" value="HARD"/>'
)
HEADINGS = (
    '<property name="vda5050:orientation.forward" value="180"/>'
    '<property name="vda5050:rotationAllowed.forward" value="false"/>'
)

PLANTS = {
    "LOAD and UNLOAD": written(LINE, {"Machine": "LOAD,UNLOAD"}, M),
    "load and unload": written(TREE, {"Machine": "load,unload"}, M),
    "Load Cargo": written(LOOP, {"Machine": "Load Cargo,Unload Cargo"}, M),
    "the operations of openTCS's demo": written(LOOP, {"Machine": "Load cargo,Unload cargo"}, M),
    "own actions of the driver": written(
        LOOP, {"Machine": "Load cargo,Unload cargo"}, M, properties=OWN_ACTION
    ),
    "headings of the driver": written(LOOP, {"Machine": "LOAD,UNLOAD"}, M).replace(
        'locked="false"/>', f'locked="false">{HEADINGS}</path>'
    ),
    "one way around": written(RING, {"Machine": "LOAD,UNLOAD"}, M),
    "other operations only": written(LOOP, {"Machine": "v-operation"}, M),
    "several operations": written(LOOP, {"Machine": "Cut,Sew,Store,NOP"}, M),
    "no operation": written(LOOP, {"Machine": ""}, M),
    "NOP only": written(LOOP, {"Machine": "NOP"}, M),
    "loading only": written(TREE, {"Machine": "LOAD"}, M),
    "unloading only": written(TREE, {"Machine": "Drop"}, M),
    "sources and sinks": written(
        LOOP, {"In": "Pick_up", "Out": "Deliver"}, {"I": ("In", 0), "O": ("Out", 3), "P": ("Out", 4)}
    ),
    "CHARGE": written(LOOP, {"Machine": "LOAD,UNLOAD", "Charger": "CHARGE"}, {**M, **CHARGER}),
    "CHARGING": written(LOOP, {"Machine": "load,unload", "Charger": "CHARGING"}, {**M, **CHARGER}),
    "Charge:50": written(LOOP, {"Machine": "Load,Unload", "Charger": "Charge:50,NOP"}, {**M, **CHARGER}),
    "chargers and places without operations": written(
        LOOP, {"Machine": "", "Charger": "charge"}, {**M, **CHARGER}
    ),
    "only chargers": written(LOOP, {"Charger": "Charging"}, CHARGER),
    "spaces and umlauts": written(
        LOOP,
        {"Übergabe Platz": "Beladen,Entladen"},
        {"Tür 1 & 2": ("Übergabe Platz", 0), "Größe/3": ("Übergabe Platz", 3)},
        names="Punkt ä {}",
        vehicles='<vehicle name="Fahrzeug Nr. 1/ü"/>',
    ),
    "a real robot's address": written(
        LOOP,
        {"Machine": "LOAD,UNLOAD"},
        M,
        vehicles='<vehicle name="V1"><property name="vda5050:manufacturer" value="ACME/Robots"/>'
        '<property name="vda5050:serialNumber" value="00 1"/>'
        '<property name="vda5050:interfaceName" value="own"/>'
        '<property name="vda5050:topicPrefix" value="site/amr"/>'
        '<property name="vda5050:version" value="3.0.0"/></vehicle>',
    ),
    "no vehicles": written(LOOP, {"Machine": "LOAD,UNLOAD"}, M, vehicles=""),
    "a part that no path leads to": written(
        LOOP, {"Machine": "LOAD,UNLOAD"}, {**M, "M3": ("Machine", 5)}, locked=[(4, 5), (5, 0), (5, 4), (0, 5)]
    ),
}


ONLY_DRIVE = "the orders only drive"
NOTES = {
    "other operations only": "execute other operations (v-operation)",
    "several operations": "execute other operations (Cut)",
    "no operation": f"{ONLY_DRIVE} (NOP)",
    "NOP only": f"{ONLY_DRIVE} (NOP)",
    "loading only": f"{ONLY_DRIVE} (NOP)",
    "unloading only": f"{ONLY_DRIVE} (NOP)",
    "chargers and places without operations": f"{ONLY_DRIVE} (NOP)",
    "only chargers": f"{ONLY_DRIVE} (MOVE)",
    "no vehicles": "The plant model has no vehicles",
}


@pytest.mark.simulation
@pytest.mark.parametrize("name", PLANTS)
def test_orders_of_each_plant_finish(name: str) -> None:
    found = run(PLANTS[name])

    assert found.finished > 0, found.unfinished
    assert found.failed == 0, found.unfinished
    assert {each.state for each in found.unfinished} <= {"DISPATCHABLE"}
    assert len(found.notes) == (name in NOTES)
    assert NOTES.get(name, "") in "".join(found.notes)


@pytest.mark.simulation
def test_two_robots_of_one_plant_drop_what_they_pick() -> None:
    found = run(PLANTS["Load Cargo"], robots=2)

    assert (found.finished > 0, found.failed) == (True, 0)
    assert found.empty_share < 1


@pytest.mark.simulation
def test_orders_that_cannot_finish_are_counted_by_reason() -> None:
    """Nothing is picked before the drop, and no path leads to the last place."""
    model = model_of(PLANTS["a part that no path leads to"])
    requests = [
        TransportOrderRequest(destinations=(Destination(location_name=place, operation=operation),))
        for place, operation in (
            ("M1", "UNLOAD"),
            ("M1", "UNLOAD"),
            ("M3", "NOP"),
            ("M3", "NOP"),
            ("M3", "NOP"),
        )
    ]
    demand = Demand(orders=tuple(Order(number * 10.0, each) for number, each in enumerate(requests)))

    found = simulate(Case(model, demand, 1, hours=0.05, speed=2.0, work_seconds=2.0))

    assert [(each.state, each.orders) for each in found.unfinished] == [("DISPATCHABLE", 3), ("FAILED", 2)]
    assert all(each.code for each in found.unfinished)
    assert "'UNLOAD'" in found.unfinished[1].reason
    report = Report((found,), (1,))
    for text in (report.to_text(), report.to_markdown(), report.to_json()):
        assert "UNLOAD" in text
        assert found.unfinished[0].code in text


@pytest.mark.parametrize(
    ("text", "what"),
    [
        (written((), {"Machine": "LOAD"}, {}), "1 robots do not fit: of 0 points"),
        (written([(0, 1), (1, 2), (2, 3)], {"Machine": "LOAD,UNLOAD"}, M), "and back"),
        (written(LINE, {"Machine": "LOAD,UNLOAD"}, M, locked=LINE), "and back"),
    ],
)
def test_a_plant_without_possible_orders_is_an_error_of_use(tmp_path: Path, text: str, what: str) -> None:
    file = tmp_path / "plant.xml"
    file.write_text(text, encoding="utf-8")

    result = CliRunner().invoke(app, [str(file), "--robots", "1"])

    assert result.exit_code == 2, result.output
    assert what in result.output
    assert len(result.output.splitlines()) == 1


def test_robots_drive_between_points_of_a_plant_without_locations() -> None:
    found = simulate(Case(model_of(written(LOOP, {}, {})), Demand(backlog=2), 1, hours=0.05))

    assert found.finished > 0
    assert any("the orders only drive (MOVE)" in note for note in found.notes)


def test_more_robots_than_places_are_an_error_of_use(tmp_path: Path) -> None:
    file = tmp_path / "plant.xml"
    file.write_text(PLANTS["LOAD and UNLOAD"], encoding="utf-8")

    result = CliRunner().invoke(app, [str(file), "--robots", "2,9"])

    assert result.exit_code == 2
    assert "9 robots do not fit" in result.output


@pytest.mark.simulation
def test_a_run_without_finished_orders_has_an_exit_status_of_its_own(tmp_path: Path) -> None:
    """Two robots on a single track cannot pass each other."""
    file = tmp_path / "plant.xml"
    track = two_way((0, 1), (1, 2))
    text = written(track, {"Machine": "LOAD,UNLOAD"}, {"M1": ("Machine", 0), "M2": ("Machine", 2)})
    file.write_text(text, encoding="utf-8")

    result = CliRunner().invoke(app, [str(file), "--robots", "2", "--hours", "0.02", "--jobs", "1"])

    assert result.exit_code == 1
    assert "no order finished with 2 robots" in result.output
    assert "stands on" in result.output
