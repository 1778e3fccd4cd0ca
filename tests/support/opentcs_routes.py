"""The routes of openTCS's web API, version 1, as its documentation has them, and what NeNa answers.

``tests/unit/order_service/extensions/opentcs/test_routes.py`` tries each row.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from nena_order_service.extensions.opentcs import OpenTcs
from nena_order_service.extensions.opentcs.events import ChangeLog
from nena_order_service.service import OrderService


def changes_of(service: OrderService) -> ChangeLog:
    """Return the changes that openTCS's web API keeps."""
    extension = service.extensions["opentcs"]
    assert isinstance(extension, OpenTcs)
    return extension.changes


@dataclass(frozen=True)
class Try:
    """A request, and the status of its answer in the sample hall with one waiting order, T-1."""

    status: int
    path: str
    body: Any = None
    query: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Route:
    """A route of openTCS's documentation."""

    method: str
    path: str
    documented: tuple[int, ...]
    """The statuses that openTCS documents."""
    note: str = ""
    """What differs in NeNa."""
    tries: tuple[Try, ...] = ()


FOR_NO_DEVICE: Final = {
    "reservationToken": "host",
    "peripheralOperation": {"operation": "open", "locationName": "Goods in"},
}
ORDER: Final = {"destinations": [{"locationName": "South 2", "operation": "MOVE"}]}
FOR_ROBOT: Final = {**ORDER, "intendedVehicle": "Robot-01"}
V: Final = "/v1/vehicles"
O: Final = "/v1/transportOrders"  # noqa: E741 - as V
S: Final = "/v1/orderSequences"
P: Final = "/v1/peripherals"
J: Final = "/v1/peripheralJobs"
PLANT_CHANGE: Final = (
    "Changes the plant model, so it needs the role `admin`: the service is rebuilt on the same store. "
    "Meanwhile requests may get 503, and open streams and polls end; robots drive on."
)
E: Final = "/v1/environmentalEntities"
ENTITIES: Final = "NeNa has no environmental entities."
DEVICES: Final = (
    "Locations with peripheral operations, by their type or on paths, have the driver `nena.mqtt`; see "
    "[peripherals.md](peripherals.md)."
)


def _named(path: str, name: str, action: str = "", **more: Any) -> tuple[Try, ...]:
    """Try an object that there is, and one that there is not."""
    return Try(200, f"{path}/{name}{action}", **more), Try(404, f"{path}/Nothing{action}", **more)


def _value(value: str) -> dict[str, str]:
    return {"newValue": value}


LEVELS: Final = {
    "energyLevelCritical": 20,
    "energyLevelGood": 60,
    "energyLevelSufficientlyRecharged": 70,
    "energyLevelFullyRecharged": 95,
}
"""Those of the sample hall, so that nothing changes."""

ROUTES: Final = (
    Route(
        "GET", O, (200, 404), "The newest 1000.", (Try(200, O), Try(404, O, query={"intendedVehicle": "X"}))
    ),
    Route("GET", f"{O}/{{name}}", (200, 404), "", _named(O, "T-1")),
    Route(
        "POST",
        f"{O}/{{name}}",
        (200, 400, 404, 409),
        "Names consist of letters, digits and `_.:-`.",
        (
            Try(200, f"{O}/T-2", ORDER),
            Try(409, f"{O}/T-1", ORDER),
            Try(400, f"{O}/T-3", {}),
            Try(404, f"{O}/T-3", {"destinations": [{"locationName": "Nowhere", "operation": "NOP"}]}),
        ),
    ),
    Route(
        "PUT",
        f"{O}/{{name}}/intendedVehicle",
        (200, 404),
        "400 if a vehicle has the order, or it belongs to a sequence.",
        (
            Try(200, f"{O}/T-1/intendedVehicle", query={"vehicle": "Robot-02"}),
            Try(200, f"{O}/T-1/intendedVehicle"),
            Try(404, f"{O}/T-1/intendedVehicle", query={"vehicle": "X"}),
            Try(404, f"{O}/Nothing/intendedVehicle"),
        ),
    ),
    Route(
        "POST",
        f"{O}/{{name}}/immediateAssignment",
        (200, 400, 404),
        "Also 200 if its intended vehicle already has it: the dispatcher assigns automatically.",
        (Try(400, f"{O}/T-1/immediateAssignment"), Try(404, f"{O}/Nothing/immediateAssignment")),
    ),
    Route(
        "POST",
        f"{O}/{{name}}/withdrawal",
        (200, 404),
        "`immediate` has no effect: the robot always gets a cancel request, "
        "and its resources are freed once it has cancelled.",
        _named(O, "T-1", "/withdrawal"),
    ),
    Route("POST", f"{O}/dispatcher/trigger", (200,), "", (Try(200, f"{O}/dispatcher/trigger"),)),
    Route("POST", "/v1/dispatcher/trigger", (200,), "", (Try(200, "/v1/dispatcher/trigger"),)),
    Route("GET", S, (200, 404), "", (Try(200, S), Try(404, S, query={"intendedVehicle": "X"}))),
    Route("GET", f"{S}/{{name}}", (200, 404), "", _named(S, "S-1")),
    Route(
        "POST",
        f"{S}/{{name}}",
        (200, 400, 404, 409),
        "Without `type` and `orderTypes`, it accepts orders of any type.",
        (Try(200, f"{S}/S-2", {}), Try(409, f"{S}/S-1", {}), Try(404, f"{S}/S-3", {"intendedVehicle": "X"})),
    ),
    Route("PUT", f"{S}/{{name}}/complete", (200, 404), "", _named(S, "S-1", "/complete")),
    Route(
        "GET",
        V,
        (200, 400),
        "",
        (Try(200, V, query={"procState": "IDLE"}), Try(400, V, query={"procState": "X"})),
    ),
    Route(
        "GET",
        f"{V}/{{name}}",
        (200, 404),
        "`allocatedResources` and `claimedResources` are empty: see `GET /v1/traffic/plan` of NeNa. "
        "`paused` is always false.",
        _named(V, "Robot-01"),
    ),
    Route(
        "POST", f"{V}/{{name}}/withdrawal", (200, 404), "As for orders.", _named(V, "Robot-01", "/withdrawal")
    ),
    Route("POST", f"{V}/{{name}}/rerouteRequest", (200, 404), "", _named(V, "Robot-01", "/rerouteRequest")),
    Route(
        "PUT",
        f"{V}/{{name}}/integrationLevel",
        (200, 404),
        "At TO_BE_IGNORED and TO_BE_NOTICED, the vehicle gives up its order; openTCS refuses this.",
        (
            *_named(V, "Robot-01", "/integrationLevel", query=_value("TO_BE_RESPECTED")),
            Try(400, f"{V}/Robot-01/integrationLevel", query=_value("X")),
        ),
    ),
    Route(
        "PUT",
        f"{V}/{{name}}/paused",
        (200, 404),
        "The robot itself is paused. 409 if it cannot be reached, 400 if it refuses: "
        "200 would mean that it has stopped.",
        (
            Try(409, f"{V}/Robot-01/paused", query=_value("true")),
            Try(404, f"{V}/Nothing/paused", query=_value("true")),
        ),
    ),
    Route(
        "PUT",
        f"{V}/{{name}}/acceptableOrderTypes",
        (200, 400, 404),
        "",
        _named(V, "Robot-01", "/acceptableOrderTypes", body={"acceptableOrderTypes": []}),
    ),
    Route(
        "PUT",
        f"{V}/{{name}}/allowedOrderTypes",
        (200, 400, 404),
        "",
        _named(V, "Robot-01", "/allowedOrderTypes", body={"orderTypes": ["*"]}),
    ),
    Route(
        "PUT",
        f"{V}/{{name}}/energyLevelThresholdSet",
        (200, 400, 404),
        PLANT_CHANGE,
        (
            *_named(V, "Robot-01", "/energyLevelThresholdSet", body=LEVELS),
            Try(400, f"{V}/Robot-01/energyLevelThresholdSet", {**LEVELS, "energyLevelCritical": 95}),
            Try(400, f"{V}/Robot-01/energyLevelThresholdSet", {}),
        ),
    ),
    Route(
        "PUT", f"{V}/{{name}}/envelopeKey", (200, 404), PLANT_CHANGE, _named(V, "Robot-01", "/envelopeKey")
    ),
    Route(
        "GET",
        f"{V}/{{name}}/commAdapter/attachmentInformation",
        (200, 404),
        "There is one driver, `nena.vda5050`.",
        _named(V, "Robot-01", "/commAdapter/attachmentInformation"),
    ),
    Route(
        "PUT",
        f"{V}/{{name}}/commAdapter/attachment",
        (200, 400, 404),
        "",
        (
            *_named(V, "Robot-01", "/commAdapter/attachment", query=_value("nena.vda5050")),
            Try(400, f"{V}/Robot-01/commAdapter/attachment", query=_value("org.example.Driver")),
        ),
    ),
    Route(
        "PUT",
        f"{V}/{{name}}/commAdapter/enabled",
        (200, 404),
        "400 for `false`: set the integration level instead.",
        (
            *_named(V, "Robot-01", "/commAdapter/enabled", query=_value("true")),
            Try(400, f"{V}/Robot-01/commAdapter/enabled", query=_value("false")),
        ),
    ),
    Route(
        "POST",
        f"{V}/{{name}}/commAdapter/message",
        (200, 404),
        "Ignored, as by a driver that does not know the message.",
        _named(V, "Robot-01", "/commAdapter/message", body={"type": "x", "parameters": []}),
    ),
    Route(
        "POST",
        f"{V}/{{name}}/routeComputationQuery",
        (200, 400, 404),
        "One route to each point, whatever `maxRoutesPerDestinationPoint` says; "
        "costs are those of `routing.costs`.",
        (
            *_named(
                V,
                "Robot-01",
                "/routeComputationQuery",
                body={"sourcePoint": "South 1", "destinationPoints": ["South 3"]},
            ),
            Try(404, f"{V}/Robot-01/routeComputationQuery", {"sourcePoint": "X", "destinationPoints": []}),
            Try(400, f"{V}/Robot-01/routeComputationQuery", {}),
        ),
    ),
    Route("POST", f"{V}/dispatcher/trigger", (200,), "", (Try(200, f"{V}/dispatcher/trigger"),)),
    Route(
        "GET",
        "/v1/plantModel",
        (200,),
        "Rules of LIF for vehicle types are left out.",
        (Try(200, "/v1/plantModel"),),
    ),
    Route(
        "PUT",
        "/v1/plantModel",
        (200, 400),
        "Needs the role `admin`. 409 while orders or vehicles use what would be removed.",
        (Try(400, "/v1/plantModel", {}), Try(400, "/v1/plantModel", [])),
    ),
    Route(
        "POST",
        "/v1/plantModel/topologyUpdateRequest",
        (200, 404),
        "Needs the role `admin`. Does nothing: locks affect routes at once.",
        (
            Try(200, "/v1/plantModel/topologyUpdateRequest"),
            Try(404, "/v1/plantModel/topologyUpdateRequest", {"paths": ["X"]}),
        ),
    ),
    Route(
        "PUT",
        "/v1/paths/{name}/locked",
        (200, 404),
        "",
        _named("/v1/paths", "South 1 --- South 2", "/locked", query=_value("true")),
    ),
    Route(
        "PUT",
        "/v1/locations/{name}/locked",
        (200, 404),
        f"{PLANT_CHANGE} Orders that exist keep a locked destination.",
        _named("/v1/locations", "Goods in", "/locked", query=_value("false")),
    ),
    Route(
        "GET",
        J,
        (200, 404),
        "The unfinished jobs and the last 1000 ended ones.",
        (
            Try(200, J),
            Try(404, J, query={"relatedVehicle": "X"}),
            Try(404, J, query={"relatedTransportOrder": "X"}),
        ),
    ),
    Route("GET", f"{J}/{{name}}", (200, 404), "", (Try(404, f"{J}/J-1"),)),
    Route(
        "POST",
        f"{J}/{{name}}",
        (200, 400, 404, 409),
        DEVICES,
        (Try(400, f"{J}/J-1", {}), Try(404, f"{J}/J-1", FOR_NO_DEVICE)),
    ),
    Route(
        "POST",
        f"{J}/{{name}}/withdrawal",
        (200, 404),
        "Jobs of transport orders, too: the vehicle then fails its drive.",
        (Try(404, f"{J}/J-1/withdrawal"),),
    ),
    Route("POST", f"{J}/dispatcher/trigger", (200,), "", (Try(200, f"{J}/dispatcher/trigger"),)),
    Route("POST", f"{P}/{{name}}/withdrawal", (200, 404), "", _named(P, "Goods in", "/withdrawal")),
    Route(
        "GET",
        f"{P}/{{name}}/commAdapter/attachmentInformation",
        (200, 404),
        "`nena.mqtt` if the location has a device.",
        _named(P, "Goods in", "/commAdapter/attachmentInformation"),
    ),
    Route(
        "PUT",
        f"{P}/{{name}}/commAdapter/attachment",
        (200, 400, 404),
        "Only `nena.mqtt`, where it is attached.",
        (
            Try(400, f"{P}/Goods in/commAdapter/attachment", query=_value("x")),
            Try(404, f"{P}/Nothing/commAdapter/attachment", query=_value("x")),
        ),
    ),
    Route(
        "PUT",
        f"{P}/{{name}}/commAdapter/enabled",
        (200, 404),
        "Always enabled where there is a device; 400 for anything else.",
        (
            *_named(P, "Goods in", "/commAdapter/enabled", query=_value("false")),
            Try(400, f"{P}/Goods in/commAdapter/enabled", query=_value("true")),
        ),
    ),
    Route("POST", f"{P}/dispatcher/trigger", (200,), "", (Try(200, f"{P}/dispatcher/trigger"),)),
    Route("GET", E, (200,), f"Empty: {ENTITIES}", (Try(200, E),)),
    Route("GET", f"{E}/{{name}}", (200,), f"404: {ENTITIES}", (Try(404, f"{E}/E-1"),)),
    Route("POST", f"{E}/{{name}}", (200, 400), f"Always 400: {ENTITIES}", (Try(400, f"{E}/E-1", {}),)),
    *(
        Route("PUT", f"{E}/{{name}}/{what}", statuses, "", (Try(404, f"{E}/E-1/{what}"),))
        for what, statuses in (
            ("envelope", (200, 400, 404)),
            ("pose", (200, 400, 404)),
            ("integrationLevel", (200, 400, 404)),
            ("retired", (200, 404)),
        )
    ),
    Route(
        "GET",
        "/v1/events",
        (200, 400),
        "The last 1000 changes; numbers begin at 0 with each start of the service. "
        "A change of the plant model drops them; the numbers continue.",
        (
            Try(200, "/v1/events", query={"timeout": "0"}),
            Try(400, "/v1/events", query={"timeout": "10001"}),
            Try(400, "/v1/events", query={"minSequenceNo": "5", "maxSequenceNo": "1"}),
        ),
    ),
    Route(
        "GET",
        "/v1/sse",
        (200,),
        "Events of vehicles, transport orders and order sequences; a heartbeat after 5 s without one. "
        "`GET /v1/events` of NeNa can be resumed.",
    ),
    Route(
        "GET",
        "/v1/kernel/version",
        (200,),
        "`baselineVersion` is the release of openTCS whose documentation is followed.",
        (Try(200, "/v1/kernel/version"),),
    ),
    Route("DELETE", "/v1/kernel", (200, 403), "Always 403.", (Try(403, "/v1/kernel"),)),
)
