"""What the API and the event stream say; one type per JSON object."""

from __future__ import annotations

from typing_extensions import TypedDict


class PositionView(TypedDict):
    """m and rad in the frame of the robot's map."""

    x: float
    y: float
    theta: float
    mapId: str
    localized: bool


class VelocityView(TypedDict):
    """m/s and rad/s in the robot's frame."""

    vx: float | None
    vy: float | None
    omega: float | None


class BatteryView(TypedDict):
    """Percent, V, m."""

    charge: float
    charging: bool
    voltage: float | None
    range: float | None


class MapView(TypedDict):
    """A map that the robot holds."""

    mapId: str
    mapVersion: str
    status: str


class GridView(TypedDict):
    """The robot's own map as an image: its lower left corner (m, rad), m per pixel, and pixels.

    The image is at ``/api/v1/robots/{manufacturer}/{serial}/map``; another ``digest``: it is another one.
    """

    digest: str
    mapId: str
    x: float
    y: float
    theta: float
    resolution: float
    width: int
    height: int


class LoadView(TypedDict):
    """kg."""

    loadId: str | None
    loadType: str | None
    loadPosition: str | None
    weight: float | None


class ErrorView(TypedDict):
    """An active error."""

    errorType: str
    errorLevel: str
    description: str | None
    hint: str | None
    references: dict[str, str]


class InformationView(TypedDict):
    """Something that the robot tells beside: goals of its navigation, for one."""

    infoType: str
    infoLevel: str
    description: str | None
    references: dict[str, str]


class ActionView(TypedDict):
    """An action that the robot knows of."""

    actionId: str
    actionType: str | None
    status: str
    result: str | None


class ActionParameterView(TypedDict):
    """A parameter of an action; `valueDataType` as in the factsheet of VDA 5050."""

    key: str
    valueDataType: str
    description: str | None
    isOptional: bool


class KnownActionView(TypedDict):
    """An action that the robot's factsheet lists."""

    actionType: str
    description: str | None
    actionScopes: list[str]
    actionParameters: list[ActionParameterView]


class AheadView(TypedDict):
    """A node that is still to be reached; m, None where the robot does not say."""

    nodeId: str
    released: bool
    x: float | None
    y: float | None


class RobotOrderView(TypedDict):
    """The VDA 5050 order that the robot holds or held last."""

    orderId: str
    orderUpdateId: int
    active: bool
    lastNodeId: str
    nodes: int
    nodesLeft: int
    progress: float
    ahead: list[AheadView]


class BodyView(TypedDict):
    """What the factsheet says of the robot's body; m."""

    seriesName: str
    robotClass: str
    kinematics: str
    length: float
    width: float
    maximumSpeed: float
    outline: list[tuple[float, float]] | None
    """Corners of the footprint in the robot's frame; None: the factsheet has none."""


class VehicleView(TypedDict):
    """What the order service says of it."""

    name: str
    state: str
    processingState: str
    reason: str
    transportOrder: str | None
    currentPosition: str | None


class RosSessionView(TypedDict):
    """Where in the ROS graph a robot's edge agent is, or will be when its session starts."""

    state: str
    namespace: str
    domainId: str


class RobotView(TypedDict):
    """One robot. Times are UTC; ages are left to the reader, who knows what time it is."""

    id: str
    manufacturer: str
    serialNumber: str
    name: str
    protocolVersion: str | None
    condition: str
    conditionSince: str
    reason: str
    reasonCode: str
    reasonValues: dict[str, str | float]
    connection: str | None
    connectionSince: str | None
    session: str
    rosSession: RosSessionView | None
    lastState: str | None
    silenceLimit: float
    clockSkew: float | None
    operatingMode: str | None
    driving: bool | None
    paused: bool | None
    position: PositionView | None
    velocity: VelocityView | None
    battery: BatteryView | None
    maps: list[MapView] | None
    grid: GridView | None
    plan: list[tuple[float, float]] | None
    """The way that it means to drive next; m, in the plant's frame."""
    loads: list[LoadView] | None
    errors: list[ErrorView]
    information: list[InformationView]
    actions: list[ActionView]
    order: RobotOrderView | None
    body: BodyView | None
    vehicle: VehicleView | None
    malformed: int
    problem: str | None


class DestinationView(TypedDict):
    """A stop of a transport order: a place's name or a coordinate, and what is done there."""

    place: str
    operation: str
    state: str


class HoldView(TypedDict):
    """Who holds a transport order, why and since when."""

    by: str
    reason: str
    since: str


class OrderView(TypedDict):
    """One transport order; ``id`` is its name."""

    id: str
    name: str
    version: int
    state: str
    final: bool
    confirmed: bool
    reason: str
    held: HoldView | None
    type: str
    priority: int
    intendedVehicle: str | None
    processingVehicle: str | None
    destinations: list[DestinationView]
    currentDestination: int
    progress: float | None
    deadline: str | None
    created: str
    finished: str | None


class PlantView(TypedDict):
    """That there is a plant model, and which; the model itself is a resource of its own."""

    version: int
    name: str
    points: int
    paths: int
    locations: int


class LinkView(TypedDict):
    """The link to the broker."""

    connected: bool
    since: str | None


class MalformedView(TypedDict):
    """Messages that could not be read."""

    counts: dict[str, int]
    lastTopic: str | None
    lastProblem: str | None
    lastTime: str | None


class FleetView(TypedDict):
    """Everything, as it was told by the changes up to ``id``."""

    id: int
    robots: list[RobotView]
    orders: list[OrderView]
    plant: PlantView | None
    link: LinkView
    malformed: MalformedView
