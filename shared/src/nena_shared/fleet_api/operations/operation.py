"""What the table says about one operation, and the REST paths of all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any, Final, Generic, Literal, TypeVar
from urllib.parse import quote

from nena_shared.fleet_api.base import DraftName, ObjectName, VersionNumber
from nena_shared.fleet_api.refusals import Refusal

A = TypeVar("A")

ORDERS: Final = "/v1/transportOrders"
ORDER_BATCH: Final = "/v1/transportOrders/batch"
SEQUENCES: Final = "/v1/orderSequences"
VEHICLES: Final = "/v1/vehicles"
POINTS: Final = "/v1/points"
LOCATIONS: Final = "/v1/locations"
PATHS: Final = "/v1/paths"
SCHEDULES: Final = "/v1/schedules"
STOPS: Final = "/v1/stops"
ZONE_SETS: Final = "/v1/zoneSets"
PERIPHERALS: Final = "/v1/peripherals"
PERIPHERAL_JOBS: Final = "/v1/peripheralJobs"
PLANT_MODEL: Final = "/v1/plantModel"
PLANT_DRAFTS: Final = "/v1/plantDrafts"
PLANT_VERSIONS: Final = "/v1/plantVersions"
SUMMARY: Final = "/v1/summary"
TRAFFIC_PLAN: Final = "/v1/traffic/plan"
WEBHOOKS: Final = "/v1/webhooks"
AUDIT: Final = "/v1/audit"
RECORDINGS: Final = "/v1/recordings"

MADE_BEFORE: Final = {HTTPStatus.OK: "Already created with this key."}


@dataclass(frozen=True, slots=True)
class Noun:
    """What all operations below one path have in common."""

    tag: str
    """Tag in the OpenAPI document."""
    subject: str = ""
    """Field of the MQTT command that corresponds to ``{name}`` in REST."""
    name_type: Any = str
    """Type of ``{name}``."""


NOUNS: Final = {
    ORDERS: Noun("transport orders", "transport_order"),
    ORDER_BATCH: Noun("transport orders"),
    SEQUENCES: Noun("order sequences", "order_sequence"),
    VEHICLES: Noun("vehicles", "vehicle"),
    POINTS: Noun("points", "point"),
    LOCATIONS: Noun("locations", "location"),
    PATHS: Noun("paths", "path"),
    SCHEDULES: Noun("schedules", "schedule", ObjectName),
    STOPS: Noun("stops", "stop"),
    ZONE_SETS: Noun("zone sets", "zone_set_id", ObjectName),
    PERIPHERALS: Noun("peripherals", "location"),
    PERIPHERAL_JOBS: Noun("peripherals", "peripheral_job"),
    PLANT_MODEL: Noun("plant model"),
    PLANT_DRAFTS: Noun("plant drafts", name_type=DraftName),
    PLANT_VERSIONS: Noun("plant drafts", name_type=VersionNumber),
    SUMMARY: Noun("summary"),
    TRAFFIC_PLAN: Noun("traffic"),
    WEBHOOKS: Noun("web hooks"),
    AUDIT: Noun("audit trail"),
    RECORDINGS: Noun("recordings"),
}


@dataclass(frozen=True, slots=True)
class Operation(Generic[A]):
    """A request that hosts can send."""

    name: str
    """Name of the operation in OpenAPI and AsyncAPI, and of the MQTT command."""
    summary: str
    method: Literal["GET", "POST", "PUT", "PATCH", "DELETE"]
    path: str
    """REST path; ``{name}`` is the name of the object."""
    answer: type[A]
    admin: bool = False
    """Whether a REST client must be an administrator; otherwise a viewer may read, and an operator change."""
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
    result: str = ""
    """Field of the MQTT answer with the result; empty: not available over MQTT, or on a separate topic."""
    request_field: str = ""
    """Field of the MQTT command with the request; empty: the request's fields are those of the command."""
    max_body: int | None = None
    """Maximum size of the body, bytes; None: ``max_body`` of the settings."""

    @property
    def noun(self) -> Noun:
        """What it has in common with the others below its path."""
        path = self.prefix.rstrip("/")
        return NOUNS.get(path) or Noun(path.split("/")[2])

    @property
    def prefix(self) -> str:
        """Part of the path before ``{name}``."""
        return self.path.partition("{")[0]

    @property
    def subject(self) -> str:
        """Field of the MQTT command that corresponds to ``{name}``; empty: it has none."""
        return self.noun.subject if "{" in self.path else ""

    def path_of(self, name: str = "") -> str:
        """Return the path of an object."""
        return self.path.replace("{name:path}", "{name}").replace("{name}", quote(name, safe=""))
