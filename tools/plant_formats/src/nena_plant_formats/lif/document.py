"""The objects of a LIF file: layouts with nodes, edges and stations (m, rad, m/s, rad/s).

They have the structure of LIF 1.0.0 and the content of both versions; `mobile_robots` defines that of 2.0.0.
"""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final, TypeVar

from pydantic import ConfigDict, Field

from nena_shared.plant.track import Coordinate, PlantRecord, VehicleTypeAtPoint, VehicleTypeOnPath


class LifVersion(StrEnum):
    """Supported versions of LIF."""

    V1_0 = "1.0.0"
    V2_0 = "2.0.0"


DRAFT_VERSION: Final = "0.11.0"
"""Version of the examples in the 1.0 guideline; their content is that of 1.0.0."""

FIELDS_OF_2_0: Final = frozenset(
    {
        "allowedDeviationXY",
        "corridor",
        "forbiddenActionTypes",
        "isJson",
        "lineGuidance",
        "manufacturers",
        "originDescriptor",
        "originId",
        "otherOrientations",
        "stationType",
    }
)
"""Names for content that LIF 1.0 cannot hold; 1.0 files have no fields of these names."""


V = TypeVar("V")


def without_none(values: Mapping[str, V | None]) -> dict[str, V]:
    """Return the values that are not None."""
    return {name: value for name, value in values.items() if value is not None}


class LifRecord(PlantRecord):
    """An object of the file. The lenient reader converts numbers to strings if needed."""

    model_config = ConfigDict(coerce_numbers_to_str=True)


class MetaInformation(LifRecord):
    """Creator, export time and format version of the file."""

    project_identification: str
    creator: str
    export_timestamp: str
    lif_version: str


class Position(LifRecord):
    """A position in the common frame of all layouts of a project."""

    x: Coordinate
    y: Coordinate


class StationPosition(Position):
    """Position at which a station is drawn."""

    theta: float | None = None


class LifNode(LifRecord):
    """A node: a position at which vehicles can be."""

    node_id: str = Field(min_length=1)
    node_name: str | None = None
    node_description: str | None = None
    # Demanded by LIF 1.0's text, but not by its schema.
    map_id: str | None = None
    node_position: Position
    vehicle_type_node_properties: tuple[VehicleTypeAtPoint, ...]


class LifEdge(LifRecord):
    """A directed connection of two nodes; the end may be in another layout."""

    edge_id: str = Field(min_length=1)
    edge_name: str | None = None
    edge_description: str | None = None
    start_node_id: str
    end_node_id: str
    vehicle_type_edge_properties: tuple[VehicleTypeOnPath, ...]


class Station(LifRecord):
    """A station, served from its interaction nodes."""

    station_id: str = Field(min_length=1)
    interaction_node_ids: tuple[str, ...]
    station_name: str | None = None
    station_type: str | None = None
    station_description: str | None = None
    station_height: float | None = None
    """None: 0 in LIF 1.0, unknown in 2.0."""
    station_position: StationPosition | None = None


class Layout(LifRecord):
    """A level of a plant, or part of a level."""

    origin_id: str | None = None
    origin_descriptor: str | None = None
    layout_id: str
    layout_name: str | None = None
    layout_version: str
    layout_level_id: str | None = None
    layout_description: str | None = None
    nodes: tuple[LifNode, ...]
    edges: tuple[LifEdge, ...]
    stations: tuple[Station, ...]


class LifFile(LifRecord):
    """A file of one integrator; IDs are unique per kind of object."""

    meta_information: MetaInformation
    layouts: tuple[Layout, ...]
    manufacturers: Mapping[str, str] = Field(default_factory=dict)
    """Manufacturers by vehicle type, where they differ from the part before the first dot."""
