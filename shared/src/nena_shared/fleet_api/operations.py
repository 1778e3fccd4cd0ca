"""The operations of the order service for hosts, each defined once.

REST routes, MQTT commands, OpenAPI and AsyncAPI documents, roles, and the client of the ``nena`` command are
generated from this table. A new operation needs an entry here and a method of
``nena_order_service.api.operations.HostOperations``; see ``docs/architecture.md``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any, Final, Generic, Literal, TypeVar
from urllib.parse import quote

from nena_shared.fleet_api import requests, transport_order
from nena_shared.fleet_api.audit import AuditPage, AuditQuery
from nena_shared.fleet_api.base import ObjectName, Role
from nena_shared.fleet_api.peripherals import (
    PeripheralJobList,
    PeripheralJobRequest,
    PeripheralJobsQuery,
    PeripheralJobStatus,
    PeripheralList,
    PeripheralStatus,
)
from nena_shared.fleet_api.plant import PathStatus, PlantModelChange, ZoneSetList, ZoneSetStatus
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.fleet_api.stops import StopEndRequest, StopList, StopRequest, StopStatus
from nena_shared.fleet_api.traffic import TrafficPlan
from nena_shared.fleet_api.vehicle import ReroutingAnswer, VehicleStatus
from nena_shared.fleet_api.webhooks import WebhookList
from nena_shared.plant.exchange import JSON_LIMITS

A = TypeVar("A")

ORDERS: Final = "/v1/transportOrders"
ORDER_BATCH: Final = "/v1/transportOrders/batch"
SEQUENCES: Final = "/v1/orderSequences"
VEHICLES: Final = "/v1/vehicles"
PATHS: Final = "/v1/paths"
STOPS: Final = "/v1/stops"
ZONE_SETS: Final = "/v1/zoneSets"
PERIPHERALS: Final = "/v1/peripherals"
PERIPHERAL_JOBS: Final = "/v1/peripheralJobs"
PLANT_MODEL: Final = "/v1/plantModel"
SUMMARY: Final = "/v1/summary"
TRAFFIC_PLAN: Final = "/v1/traffic/plan"
WEBHOOKS: Final = "/v1/webhooks"
AUDIT: Final = "/v1/audit"

BATCH_BYTES: Final = 1_000_000
"""Maximum size of a batch of orders: 1,000 orders with two destinations have about 0.3 MB."""

MADE_BEFORE: Final = {HTTPStatus.OK: "Already created with this key."}


_NEW_ORDER: Final = (Refusal.KEY_REUSED, Refusal.NOT_IN_PLANT, Refusal.UNKNOWN_IN_PLANT, Refusal.NOT_SAVED)
_STORED_ORDER: Final = (Refusal.UNKNOWN_ORDER, Refusal.NOT_SAVED)
_ORDER_CHANGE: Final = (*_STORED_ORDER, Refusal.ORDER_ENDED, Refusal.VERSION_CHANGED)
_VEHICLE_CHANGE: Final = (Refusal.UNKNOWN_VEHICLE, Refusal.NOT_SAVED)
_ZONE_SET_CHANGE: Final = (Refusal.UNKNOWN_ZONE_SET, Refusal.NOT_SAVED)


@dataclass(frozen=True, slots=True)
class Operation(Generic[A]):
    """A request that hosts can send."""

    name: str
    """Name of the operation in OpenAPI and AsyncAPI, and of the MQTT command."""
    summary: str
    method: Literal["GET", "POST", "PUT", "DELETE"]
    path: str
    """REST path; ``{name}`` is the name of the object."""
    answer: type[A]
    role: Role
    """Minimum role of REST clients."""
    request: Any = None
    """Type of the body, or of the query parameters for GET; None: no body."""
    may_be_empty: bool = False
    """Whether the body may be omitted to use all defaults."""
    versioned: bool = False
    """Whether the object has a version: ETag over REST, ``version`` in an MQTT command."""
    creates: str = ""
    """Path of the created object (status 201); empty: creates no object (status 200)."""
    also: Mapping[HTTPStatus, str] = field(default_factory=dict)
    """Other success statuses with their descriptions."""
    refusals: tuple[Refusal, ...] = ()
    """Reasons for rejection, in addition to malformed requests and access control."""
    name_type: Any = str
    """Type of ``{name}``."""
    subject: str = ""
    """Field of the MQTT command that corresponds to ``{name}`` in REST."""
    result: str = ""
    """Field of the MQTT answer with the result; empty: not available over MQTT, or on a separate topic."""
    request_field: str = ""
    """Field of the MQTT command with the request; empty: the request's fields are those of the command."""
    max_body: int | None = None
    """Maximum size of the body, bytes; None: ``max_body`` of the settings."""
    opentcs: tuple[str, ...] = ()
    """Equivalent routes of openTCS's web API, as ``METHOD path`` below ``opentcs_prefix``."""

    @property
    def tag(self) -> str:
        """Tag in the OpenAPI document."""
        return TAGS[self.prefix.rstrip("/")]

    @property
    def prefix(self) -> str:
        """Part of the path before ``{name}``."""
        return self.path.partition("{")[0]

    def path_of(self, name: str = "") -> str:
        """Return the path of an object."""
        return self.path.replace("{name:path}", "{name}").replace("{name}", quote(name, safe=""))


TAGS: Final = {
    ORDERS: "transport orders",
    ORDER_BATCH: "transport orders",
    SEQUENCES: "order sequences",
    VEHICLES: "vehicles",
    PATHS: "paths",
    STOPS: "stops",
    ZONE_SETS: "zone sets",
    PERIPHERALS: "peripherals",
    PERIPHERAL_JOBS: "peripherals",
    PLANT_MODEL: "plant model",
    SUMMARY: "summary",
    TRAFFIC_PLAN: "traffic",
    WEBHOOKS: "web hooks",
    AUDIT: "audit trail",
}

CREATE_ORDER = Operation(
    "createTransportOrder",
    "Create a transport order. It is stored before the response is sent.",
    "POST",
    ORDERS,
    transport_order.TransportOrderStatus,
    Role.OPERATOR,
    request=transport_order.TransportOrderRequest,
    versioned=True,
    creates=ORDERS,
    also=MADE_BEFORE,
    opentcs=(f"POST {ORDERS}/{{name}}",),
    refusals=(
        *_NEW_ORDER,
        Refusal.NAME_TAKEN,
        Refusal.UNKNOWN_DEPENDENCY,
        Refusal.UNKNOWN_SEQUENCE,
        Refusal.SEQUENCE_REFUSES,
    ),
)
CREATE_ORDERS = Operation(
    "createTransportOrders",
    "Create up to 1000 transport orders, each on its own: some may be refused.",
    "POST",
    ORDER_BATCH,
    transport_order.TransportOrderBatchAnswer,
    Role.OPERATOR,
    request=transport_order.TransportOrderBatch,
    refusals=(Refusal.NOT_SAVED,),
    max_body=BATCH_BYTES,
)
LIST_ORDERS = Operation(
    "transportOrders",
    "List transport orders, newest first.",
    "GET",
    ORDERS,
    requests.TransportOrderPage,
    Role.VIEWER,
    request=requests.TransportOrdersQuery,
    opentcs=(f"GET {ORDERS}",),
    refusals=(Refusal.NOT_SAVED,),
)
SHOW_ORDER = Operation(
    "transportOrder",
    "Return a transport order with its history. Its version is the ETag.",
    "GET",
    f"{ORDERS}/{{name}}",
    transport_order.TransportOrderStatus,
    Role.VIEWER,
    versioned=True,
    opentcs=(f"GET {ORDERS}/{{name}}",),
    refusals=_STORED_ORDER,
)
DELIVERY = Operation(
    "delivery",
    "Return the delivery of a transport order to its robot.",
    "GET",
    f"{ORDERS}/{{name}}/delivery",
    transport_order.DeliveryStatus,
    Role.VIEWER,
    subject="transport_order",
    result="delivery",
    refusals=_STORED_ORDER,
)
ASSIGNMENT = Operation(
    "assignment",
    "Return for each vehicle whether it could execute a transport order, or why not.",
    "GET",
    f"{ORDERS}/{{name}}/assignment",
    transport_order.AssignmentStatus,
    Role.VIEWER,
    request=requests.AssignmentQuery,
    subject="transport_order",
    result="assignment",
    refusals=_STORED_ORDER,
)
WITHDRAW = Operation(
    "withdraw",
    "Withdraw a transport order. It fails at once, or when its vehicle has released it.",
    "POST",
    f"{ORDERS}/{{name}}/withdrawal",
    transport_order.TransportOrderStatus,
    Role.OPERATOR,
    request=requests.WithdrawalRequest,
    may_be_empty=True,
    versioned=True,
    subject="transport_order",
    result="transport_order",
    opentcs=(
        f"POST {ORDERS}/{{name}}/withdrawal",
        f"POST {VEHICLES}/{{name}}/withdrawal",
    ),
    refusals=_ORDER_CHANGE,
)
HOLD = Operation(
    "hold",
    "Hold a transport order until it is resumed. It keeps its vehicle, which stops.",
    "POST",
    f"{ORDERS}/{{name}}/hold",
    transport_order.TransportOrderStatus,
    Role.OPERATOR,
    request=requests.HoldRequest,
    may_be_empty=True,
    versioned=True,
    subject="transport_order",
    result="transport_order",
    refusals=(*_ORDER_CHANGE, Refusal.ORDER_WITHDRAWN),
)
RESUME = Operation(
    "resume",
    "Resume a held transport order from where its vehicle is.",
    "POST",
    f"{ORDERS}/{{name}}/resume",
    transport_order.TransportOrderStatus,
    Role.OPERATOR,
    request=requests.ResumeRequest,
    may_be_empty=True,
    versioned=True,
    subject="transport_order",
    result="transport_order",
    refusals=_ORDER_CHANGE,
)

CREATE_SEQUENCE = Operation(
    "createOrderSequence",
    "Create an order sequence. Orders join it by naming it as their wrappingSequence.",
    "POST",
    SEQUENCES,
    transport_order.OrderSequenceStatus,
    Role.OPERATOR,
    request=transport_order.OrderSequenceRequest,
    versioned=True,
    creates=SEQUENCES,
    also=MADE_BEFORE,
    result="order_sequence",
    opentcs=(f"POST {SEQUENCES}/{{name}}",),
    refusals=(Refusal.UNKNOWN_VEHICLE, Refusal.NAME_TAKEN, Refusal.KEY_REUSED, Refusal.NOT_SAVED),
)
LIST_SEQUENCES = Operation(
    "orderSequences",
    "List order sequences, newest first.",
    "GET",
    SEQUENCES,
    requests.OrderSequencePage,
    Role.VIEWER,
    request=requests.OrderSequencesQuery,
    result="order_sequences",
    opentcs=(f"GET {SEQUENCES}",),
    refusals=(Refusal.NOT_SAVED,),
)
SHOW_SEQUENCE = Operation(
    "orderSequence",
    "Return an order sequence with its history. Its version is the ETag.",
    "GET",
    f"{SEQUENCES}/{{name}}",
    transport_order.OrderSequenceStatus,
    Role.VIEWER,
    versioned=True,
    subject="order_sequence",
    result="order_sequence",
    opentcs=(f"GET {SEQUENCES}/{{name}}",),
    refusals=(Refusal.UNKNOWN_SEQUENCE, Refusal.NOT_SAVED),
)
COMPLETE_SEQUENCE = Operation(
    "completeOrderSequence",
    "Mark an order sequence complete. It accepts no more orders and ends with its last one.",
    "POST",
    f"{SEQUENCES}/{{name}}/completion",
    transport_order.OrderSequenceStatus,
    Role.OPERATOR,
    versioned=True,
    subject="order_sequence",
    result="order_sequence",
    opentcs=(f"PUT {SEQUENCES}/{{name}}/complete",),
    refusals=(Refusal.UNKNOWN_SEQUENCE, Refusal.VERSION_CHANGED, Refusal.NOT_SAVED),
)

LIST_VEHICLES = Operation(
    "vehicles",
    "List the vehicles, also robots that are not in the plant model.",
    "GET",
    VEHICLES,
    requests.VehicleList,
    Role.VIEWER,
    request=requests.VehiclesQuery,
    opentcs=(f"GET {VEHICLES}",),
    refusals=(Refusal.UNKNOWN_VEHICLE,),
)
SHOW_VEHICLE = Operation(
    "vehicle",
    "Return a vehicle.",
    "GET",
    f"{VEHICLES}/{{name}}",
    VehicleStatus,
    Role.VIEWER,
    opentcs=(f"GET {VEHICLES}/{{name}}",),
    refusals=(Refusal.UNKNOWN_VEHICLE,),
)
INTEGRATION_LEVEL = Operation(
    "integrationLevel",
    "Set the integration level of a vehicle: whether it gets orders, and whether others avoid it.",
    "PUT",
    f"{VEHICLES}/{{name}}/integrationLevel",
    VehicleStatus,
    Role.OPERATOR,
    request=requests.IntegrationLevelRequest,
    subject="vehicle",
    result="vehicle",
    refusals=_VEHICLE_CHANGE,
    opentcs=(f"PUT {VEHICLES}/{{name}}/integrationLevel",),
)
ORDER_TYPES = Operation(
    "acceptableOrderTypes",
    "Set the order types that a vehicle accepts. It finishes its current order.",
    "PUT",
    f"{VEHICLES}/{{name}}/acceptableOrderTypes",
    VehicleStatus,
    Role.OPERATOR,
    request=requests.OrderTypesRequest,
    subject="vehicle",
    result="vehicle",
    opentcs=(
        f"PUT {VEHICLES}/{{name}}/acceptableOrderTypes",
        f"PUT {VEHICLES}/{{name}}/allowedOrderTypes",
    ),
    refusals=_VEHICLE_CHANGE,
)
DISPATCH = Operation(
    "dispatch",
    "Send a vehicle to a point, location or coordinate with a new transport order.",
    "POST",
    f"{VEHICLES}/{{name}}/dispatch",
    transport_order.TransportOrderStatus,
    Role.OPERATOR,
    request=requests.DispatchRequest,
    creates=ORDERS,
    subject="vehicle",
    result="transport_order",
    refusals=(*_NEW_ORDER, Refusal.UNKNOWN_VEHICLE),
)
INSTANT_ACTION = Operation(
    "instantAction",
    "Send an instant action to a vehicle and wait for its end, up to a timeout.",
    "POST",
    f"{VEHICLES}/{{name}}/instantActions",
    requests.InstantActionAnswer,
    Role.OPERATOR,
    request=requests.InstantActionRequest,
    also={HTTPStatus.ACCEPTED: "It is still running."},
    subject="vehicle",
    result="instant_action",
    opentcs=(f"PUT {VEHICLES}/{{name}}/paused",),
    refusals=(
        Refusal.UNKNOWN_VEHICLE,
        Refusal.NOT_REACHED,
        Refusal.VEHICLE_BUSY,
        Refusal.VEHICLE_STOPPED,
    ),
)
REROUTE = Operation(
    "reroute",
    "Replan the route of a vehicle's current order, from the end of its base.",
    "POST",
    f"{VEHICLES}/{{name}}/rerouting",
    ReroutingAnswer,
    Role.OPERATOR,
    request=requests.ReroutingRequest,
    subject="vehicle",
    result="rerouting",
    opentcs=(f"POST {VEHICLES}/{{name}}/rerouteRequest",),
    refusals=(*_VEHICLE_CHANGE, Refusal.NOT_REROUTABLE, Refusal.NOT_REACHED),
)

LIST_PATHS = Operation(
    "paths", "List the paths, and which of them are locked.", "GET", PATHS, requests.PathList, Role.VIEWER
)
LOCK_PATH = Operation(
    "lockPath",
    "Lock or unlock a path. New routes avoid a locked path, also those of driving vehicles.",
    "PUT",
    f"{PATHS}/{{name:path}}/lock",
    PathStatus,
    Role.OPERATOR,
    request=requests.PathLockRequest,
    subject="path",
    result="path",
    opentcs=(f"PUT {PATHS}/{{name:path}}/locked",),
    refusals=(Refusal.UNKNOWN_PATH, Refusal.NOT_SAVED),
)
SHOW_PATH = Operation(
    "path",
    "Return a path.",
    "GET",
    f"{PATHS}/{{name:path}}",
    PathStatus,
    Role.VIEWER,
    refusals=(Refusal.UNKNOWN_PATH,),
)

LIST_STOPS = Operation(
    "stops",
    "List the active stops, with who began each one and why.",
    "GET",
    STOPS,
    StopList,
    Role.VIEWER,
    result="stops",
)
STOP = Operation(
    "stop",
    "Pause all robots, or those in an area and keep others out, until a person ends the stop.",
    "POST",
    STOPS,
    StopStatus,
    Role.OPERATOR,
    request=StopRequest,
    result="stop",
    refusals=(Refusal.TOO_MANY_STOPS, Refusal.NOT_SAVED),
)
END_STOP = Operation(
    "endStop",
    "End a stop. The robots that it has paused continue, unless another stop pauses them.",
    "POST",
    f"{STOPS}/{{name}}/end",
    StopStatus,
    Role.OPERATOR,
    request=StopEndRequest,
    may_be_empty=True,
    subject="stop",
    result="stop",
    refusals=(Refusal.UNKNOWN_STOP, Refusal.NOT_SAVED),
)

LIST_ZONE_SETS = Operation(
    "zoneSets",
    "List the zone sets and their status at the robots.",
    "GET",
    ZONE_SETS,
    ZoneSetList,
    Role.VIEWER,
)
SHOW_ZONE_SET = Operation(
    "zoneSet",
    "Return a zone set's status at the robots.",
    "GET",
    f"{ZONE_SETS}/{{name}}",
    ZoneSetStatus,
    Role.VIEWER,
    name_type=ObjectName,
    refusals=(Refusal.UNKNOWN_ZONE_SET,),
)
PUT_ZONE_SET = Operation(
    "putZoneSet",
    "Store a zone set (VDA 5050 3.0, 6.4) and send it, disabled, to all robots of version 3.0.",
    "POST",
    ZONE_SETS,
    ZoneSetStatus,
    Role.ADMIN,
    request=requests.ZoneSetRequest,
    request_field="zone_set",
    result="zone_set",
    refusals=(Refusal.ZONE_SET_CHANGED, Refusal.NOT_SAVED),
)
ENABLE_ZONE_SET = Operation(
    "enableZoneSet",
    "Enable a zone set on the robots, and disable others of its map.",
    "POST",
    f"{ZONE_SETS}/{{name}}/enable",
    ZoneSetStatus,
    Role.ADMIN,
    subject="zone_set_id",
    result="zone_set",
    name_type=ObjectName,
    refusals=_ZONE_SET_CHANGE,
)
DELETE_ZONE_SET = Operation(
    "deleteZoneSet",
    "Delete a zone set on the robots. They keep an enabled one until another one is enabled.",
    "DELETE",
    f"{ZONE_SETS}/{{name}}",
    ZoneSetStatus,
    Role.ADMIN,
    subject="zone_set_id",
    result="zone_set",
    name_type=ObjectName,
    refusals=_ZONE_SET_CHANGE,
)

LIST_PERIPHERALS = Operation(
    "peripherals",
    "List the peripheral devices, such as doors, with the job that each executes.",
    "GET",
    PERIPHERALS,
    PeripheralList,
    Role.VIEWER,
    result="peripherals",
)
SHOW_PERIPHERAL = Operation(
    "peripheral",
    "Return the peripheral device of a location.",
    "GET",
    f"{PERIPHERALS}/{{name:path}}",
    PeripheralStatus,
    Role.VIEWER,
    subject="location",
    result="peripheral",
    refusals=(Refusal.UNKNOWN_PERIPHERAL,),
)
LIST_JOBS = Operation(
    "peripheralJobs",
    "List the unfinished peripheral jobs and the last 1000 ended ones, newest first.",
    "GET",
    PERIPHERAL_JOBS,
    PeripheralJobList,
    Role.VIEWER,
    request=PeripheralJobsQuery,
    result="peripheral_jobs",
)
SHOW_JOB = Operation(
    "peripheralJob",
    "Return a peripheral job.",
    "GET",
    f"{PERIPHERAL_JOBS}/{{name}}",
    PeripheralJobStatus,
    Role.VIEWER,
    subject="peripheral_job",
    result="peripheral_job",
    refusals=(Refusal.UNKNOWN_JOB,),
)
CREATE_JOB = Operation(
    "createPeripheralJob",
    "Create a peripheral job for no vehicle. It waits while a vehicle with another token uses the device.",
    "POST",
    PERIPHERAL_JOBS,
    PeripheralJobStatus,
    Role.OPERATOR,
    request=PeripheralJobRequest,
    creates=PERIPHERAL_JOBS,
    result="peripheral_job",
    refusals=(
        Refusal.NAME_TAKEN,
        Refusal.UNKNOWN_PERIPHERAL,
        Refusal.NOT_IN_PLANT,
        Refusal.NOT_SAVED,
    ),
)
WITHDRAW_JOB = Operation(
    "withdrawPeripheralJob",
    "Withdraw a peripheral job. Its device is told, and a vehicle that requires the job fails its drive.",
    "POST",
    f"{PERIPHERAL_JOBS}/{{name}}/withdrawal",
    PeripheralJobStatus,
    Role.OPERATOR,
    subject="peripheral_job",
    result="peripheral_job",
    refusals=(Refusal.UNKNOWN_JOB, Refusal.JOB_ENDED, Refusal.NOT_SAVED),
)

SUMMARISE = Operation(
    "summary",
    "Count unfinished orders and vehicles by state.",
    "GET",
    SUMMARY,
    requests.FleetSummary,
    Role.VIEWER,
    result="summary",
)

SHOW_TRAFFIC_PLAN = Operation(
    "trafficPlan",
    "Return where vehicles will be in the next minute, what they hold, and what they wait for and why.",
    "GET",
    TRAFFIC_PLAN,
    TrafficPlan,
    Role.VIEWER,
    result="traffic_plan",
)

CHANGE_PLANT = Operation(
    "changePlantModel",
    "Replace the plant model: openTCS XML, LIF (strictly by its standard), or NeNa JSON.",
    "PUT",
    PLANT_MODEL,
    PlantModelChange,
    Role.ADMIN,
    max_body=JSON_LIMITS.size_bytes,
    refusals=(Refusal.INVALID_PLANT, Refusal.PLANT_IN_USE, Refusal.NOT_SAVED),
)
"""The body is a file in one of several formats, so this route is written by hand."""

LIST_WEBHOOKS = Operation(
    "webhooks",
    "List the web hooks with their last attempts.",
    "GET",
    WEBHOOKS,
    WebhookList,
    Role.ADMIN,
)

LIST_AUDIT = Operation(
    "auditTrail",
    "List who changed what, newest first, in rows that are chained by hashes.",
    "GET",
    AUDIT,
    AuditPage,
    Role.ADMIN,
    request=AuditQuery,
    refusals=(Refusal.NOT_SAVED,),
)

OPERATIONS: Final[tuple[Operation[Any], ...]] = (
    CREATE_ORDER,
    CREATE_ORDERS,
    LIST_ORDERS,
    SHOW_ORDER,
    DELIVERY,
    ASSIGNMENT,
    WITHDRAW,
    HOLD,
    RESUME,
    CREATE_SEQUENCE,
    LIST_SEQUENCES,
    SHOW_SEQUENCE,
    COMPLETE_SEQUENCE,
    LIST_VEHICLES,
    SHOW_VEHICLE,
    INTEGRATION_LEVEL,
    ORDER_TYPES,
    DISPATCH,
    INSTANT_ACTION,
    REROUTE,
    LIST_PATHS,
    LOCK_PATH,
    SHOW_PATH,
    LIST_STOPS,
    STOP,
    END_STOP,
    LIST_ZONE_SETS,
    SHOW_ZONE_SET,
    PUT_ZONE_SET,
    ENABLE_ZONE_SET,
    DELETE_ZONE_SET,
    LIST_PERIPHERALS,
    SHOW_PERIPHERAL,
    LIST_JOBS,
    SHOW_JOB,
    CREATE_JOB,
    WITHDRAW_JOB,
    SUMMARISE,
    SHOW_TRAFFIC_PLAN,
    LIST_WEBHOOKS,
    LIST_AUDIT,
)
"""All operations with generated routes. A route that also matches another one's path comes after it."""

COMMANDS: Final[Mapping[str, Operation[Any]]] = {each.name: each for each in OPERATIONS if each.result}
"""Operations of MQTT commands, by name."""
