"""The plant model in openTCS's vocabulary, its importers and the transform between plant and robot maps."""

from nena_shared.plant.block import Block, BlockType
from nena_shared.plant.errors import ObjectKind, PlantModelError, Problem, UnknownObjectError
from nena_shared.plant.geometry import BoundingBox, Envelope, LabelLayout, Vertex
from nena_shared.plant.location import Link, Location, LocationLayout, LocationType
from nena_shared.plant.model import NO_OPERATION, RECHARGE_OPERATION, PlantModel
from nena_shared.plant.path import (
    BACKWARD_SUFFIX,
    ConnectionType,
    ControlPoint,
    DirectedEdge,
    ExecutionTrigger,
    Orientation,
    Path,
    PathLayout,
    PeripheralOperation,
)
from nena_shared.plant.point import Point, PointType
from nena_shared.plant.transform import MapPlace, MapPose, MapTransform, PlantPlace, PlantPose
from nena_shared.plant.vehicle import EnergyThresholds, Vehicle
from nena_shared.plant.visual_layout import Layer, LayerGroup, VisualLayout

__all__ = [
    "BACKWARD_SUFFIX",
    "NO_OPERATION",
    "RECHARGE_OPERATION",
    "Block",
    "BlockType",
    "BoundingBox",
    "ConnectionType",
    "ControlPoint",
    "DirectedEdge",
    "EnergyThresholds",
    "Envelope",
    "ExecutionTrigger",
    "LabelLayout",
    "Layer",
    "LayerGroup",
    "Link",
    "Location",
    "LocationLayout",
    "LocationType",
    "MapPlace",
    "MapPose",
    "MapTransform",
    "ObjectKind",
    "Orientation",
    "Path",
    "PathLayout",
    "PeripheralOperation",
    "PlantModel",
    "PlantModelError",
    "PlantPlace",
    "PlantPose",
    "Point",
    "PointType",
    "Problem",
    "UnknownObjectError",
    "Vehicle",
    "Vertex",
    "VisualLayout",
]
