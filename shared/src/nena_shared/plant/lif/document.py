"""The objects of a LIF 1.0.0 file: layouts with nodes, edges and stations (m, rad, m/s, rad/s)."""

from pydantic import ConfigDict, Field

from nena_shared.plant.track import Coordinate, PlantRecord, VehicleTypeAtPoint, VehicleTypeOnPath


class LifRecord(PlantRecord):
    """An object of the file. The lenient reader converts numbers to strings where needed."""

    model_config = ConfigDict(coerce_numbers_to_str=True)


class MetaInformation(LifRecord):
    """Creator, time of export and format version of the file."""

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
    """A node: position where vehicles can be."""

    node_id: str = Field(min_length=1)
    node_name: str | None = None
    node_description: str | None = None
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
    station_description: str | None = None
    station_height: float = 0.0
    station_position: StationPosition | None = None


class Layout(LifRecord):
    """A level of a plant, or part of a level."""

    layout_id: str
    layout_name: str | None = None
    layout_version: str
    layout_level_id: str | None = None
    layout_description: str | None = None
    nodes: tuple[LifNode, ...]
    edges: tuple[LifEdge, ...]
    stations: tuple[Station, ...]


class LifFile(LifRecord):
    """A whole file of one integrator; ids are unique for each kind of object in the file."""

    meta_information: MetaInformation
    layouts: tuple[Layout, ...]
