"""The JSON objects of API and event stream."""

from __future__ import annotations

from typing_extensions import TypedDict

from nena_shared.fleet_api.attention import Matter
from nena_shared.mqtt.broker_check import BrokerLack


class PositionView(TypedDict):
    """Position, m and rad in the frame of the map."""

    x: float
    y: float
    theta: float
    mapId: str
    localized: bool


class VelocityView(TypedDict):
    """Velocity, m/s and rad/s in the robot's frame."""

    vx: float | None
    vy: float | None
    omega: float | None


class BatteryView(TypedDict):
    """Battery: charge in percent, voltage in V, range in m."""

    charge: float
    charging: bool
    voltage: float | None
    range: float | None


class MapView(TypedDict):
    """A map stored on the robot."""

    mapId: str
    mapVersion: str
    status: str


class GridView(TypedDict):
    """The robot's grid map as an image: pose of its lower left corner (m, rad), m per pixel, size in pixels.

    The image is at ``/api/v1/robots/{manufacturer}/{serial}/map``; a new ``digest`` means a new image.
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
    """A load; weight in kg."""

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
    """An information entry of the state, e.g. a navigation goal."""

    infoType: str
    infoLevel: str
    description: str | None
    references: dict[str, str]


class ActionView(TypedDict):
    """An action in the robot's state."""

    actionId: str
    actionType: str | None
    status: str
    result: str | None


class ActionParameterView(TypedDict):
    """A parameter of an action; `valueDataType` as in the VDA 5050 factsheet."""

    key: str
    valueDataType: str
    description: str | None
    isOptional: bool


class KnownActionView(TypedDict):
    """An action listed in the robot's factsheet."""

    actionType: str
    description: str | None
    actionScopes: list[str]
    actionParameters: list[ActionParameterView]


class AheadView(TypedDict):
    """A node that has not been reached yet; position in m, null if not reported."""

    nodeId: str
    released: bool
    x: float | None
    y: float | None


class RobotOrderView(TypedDict):
    """The robot's current or last VDA 5050 order."""

    orderId: str
    orderUpdateId: int
    active: bool
    lastNodeId: str
    nodes: int
    nodesLeft: int
    progress: float
    ahead: list[AheadView]


class BodyView(TypedDict):
    """Type and dimensions (m, m/s) from the factsheet."""

    seriesName: str
    robotClass: str
    kinematics: str
    length: float
    width: float
    maximumSpeed: float
    outline: list[tuple[float, float]] | None
    """Corners of the footprint in the robot's frame; null if the factsheet has none."""


class CodedReasonView(TypedDict):
    """A reason of the order service, for other languages than English."""

    code: str
    """Code, as of the order service."""
    values: dict[str, str | int | float]
    causes: list[CodedReasonView]


class WaitView(TypedDict):
    """The vehicles that a vehicle waits for, where and why, and the head of the queue."""

    vehicles: list[str]
    at: str | None
    cause: str | None
    reason: str
    codedReason: CodedReasonView | None
    next: str | None
    """The next vehicle in the queue; null if the vehicle is not in one."""
    head: str | None
    """The vehicle that all of them wait for in the end; null in a circle."""
    circle: list[str]
    """Vehicles that wait for each other, each for the one after it."""


class SetByView(TypedDict):
    """Who has set something, and when."""

    by: str
    since: str


class VehicleView(TypedDict):
    """The robot's vehicle in the order service."""

    name: str
    state: str
    processingState: str
    integrationLevel: str
    levelSet: SetByView | None
    reason: str
    codedReason: CodedReasonView | None
    transportOrder: str | None
    currentPosition: str | None
    wait: WaitView | None


class RosSessionView(TypedDict):
    """ROS namespace and domain of the robot's edge agent, and the state of its session."""

    state: str
    namespace: str
    domainId: str


class RobotView(TypedDict):
    """A robot. Times are UTC."""

    id: str
    manufacturer: str
    serialNumber: str
    name: str
    protocolVersion: str | None
    condition: str
    conditionSince: str
    urgent: bool
    """Whether the robot needs a person now: emergency stop, error, lost position."""
    reason: str
    reasonCode: str
    reasonValues: dict[str, str | float]
    codedReason: CodedReasonView | None
    """The order service's reason that it contains, if any."""
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
    """Planned path, m in the plant frame."""
    loads: list[LoadView] | None
    errors: list[ErrorView]
    information: list[InformationView]
    actions: list[ActionView]
    order: RobotOrderView | None
    body: BodyView | None
    vehicle: VehicleView | None
    malformed: int
    problem: str | None
    deviations: list[str]
    """How its messages deviate from VDA 5050, and how they were read, as text."""


class DestinationView(TypedDict):
    """A destination of a transport order: place or coordinate, with its operation."""

    place: str
    operation: str
    state: str


class HoldView(TypedDict):
    """Who put a transport order on hold, why and since when."""

    by: str
    reason: str
    codedReason: CodedReasonView | None
    since: str


class OrderView(TypedDict):
    """A transport order; ``id`` is its name."""

    id: str
    name: str
    version: int
    state: str
    final: bool
    outcome: str | None
    """How it ended: FAILED, but also WITHDRAWN and GAVE_WAY, which are no failures."""
    automatic: bool
    createdBy: str | None
    dependencies: list[str]
    """Names of the orders that it waits for."""
    confirmed: bool
    reason: str
    codedReason: CodedReasonView | None
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


class PeripheralJobView(TypedDict):
    """A job of a peripheral device, for a vehicle or a host."""

    name: str
    state: str
    operation: str
    reason: str
    """What it waits for, or why it failed."""
    codedReason: CodedReasonView | None
    vehicle: str | None
    transportOrder: str | None
    path: str | None
    created: str
    finished: str | None


class PeripheralView(TypedDict):
    """A peripheral device, such as a door; ``id`` is its location."""

    id: str
    state: str
    confirmed: bool
    operations: list[str]
    waiting: int
    """Number of jobs that wait for it."""
    usedBy: list[str]
    """Vehicles that hold a part of their route for which it is needed."""
    job: PeripheralJobView | None
    """The job that it executes."""
    jobs: list[PeripheralJobView]
    """Its first unfinished jobs, then the last ended ones, newest first."""


class PlantView(TypedDict):
    """Summary of the plant model, which has its own resource."""

    version: int
    name: str
    points: int
    paths: int
    locations: int


class LinkView(TypedDict):
    """The MQTT broker connection."""

    connected: bool
    since: str | None


class AreaView(TypedDict):
    """A rectangle, m in the plant frame; on all maps if ``mapId`` is null."""

    xMin: float
    yMin: float
    xMax: float
    yMax: float
    mapId: str | None


class UnpausedView(TypedDict):
    """A vehicle that a stop should pause but that is not paused, and why."""

    vehicle: str
    reason: str
    codedReason: CodedReasonView | None


class StopView(TypedDict):
    """A stop: all robots, or those in an area, are paused until a person ends it."""

    name: str
    by: str
    reason: str
    since: str
    area: AreaView | None
    """Null: all robots."""
    vehicles: int
    paused: int
    notPaused: list[UnpausedView]
    direct: bool
    """Whether the robots were paused without the order service, which does not know the stop yet."""


class OrderServiceView(TypedDict):
    """Whether the order service is up; null: no status received."""

    up: bool | None
    lastSign: str | None
    """Time of its last heartbeat, if it is down."""
    stops: list[StopView]
    """The active stops, the oldest first; if it is down, the last known ones."""
    brokerLacks: list[BrokerLack]
    """What the MQTT broker does not do."""


class JamView(TypedDict):
    """A jam: many robots that have waited long behind one head."""

    head: str | None
    """The vehicle that all of them wait for in the end; null in a circle."""
    circle: list[str]
    """Vehicles that wait for each other, each for the one after it."""
    robots: int
    """Waiting robots; the head is not counted."""
    since: str


class MalformedView(TypedDict):
    """Unreadable messages."""

    counts: dict[str, int]
    lastTopic: str | None
    lastProblem: str | None
    lastTime: str | None


class FleetParts(TypedDict):
    """The whole fleet as of change ``id``, but its robots."""

    id: int
    orders: list[OrderView]
    peripherals: list[PeripheralView]
    plant: PlantView | None
    link: LinkView
    orderService: OrderServiceView
    jams: list[JamView]
    attention: list[Matter]
    malformed: MalformedView


class FleetView(FleetParts):
    """The whole fleet as of change ``id``."""

    robots: list[RobotView]
