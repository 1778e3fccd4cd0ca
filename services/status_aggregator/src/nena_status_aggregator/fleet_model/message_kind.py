"""The kinds of messages that the aggregator listens to."""

from __future__ import annotations

from enum import StrEnum


class MessageKind(StrEnum):
    """Bounded on purpose: the kind is a label of metrics."""

    CONNECTION = "connection"
    STATE = "state"
    VISUALIZATION = "visualization"
    FACTSHEET = "factsheet"
    ROBOT_MAP = "robotMap"
    ORDER_STATUS = "orderStatus"
    VEHICLE_STATUS = "vehicleStatus"
    PLANT_MODEL = "plantModel"
