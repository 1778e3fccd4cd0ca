"""Settings of the order service."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field, HttpUrl, SecretStr

from nena_order_service.context import EngineSettings
from nena_order_service.fleet import FleetSettings
from nena_order_service.routing import CostKey
from nena_shared.fleet_api.transport_order import FailurePolicy
from nena_shared.settings import ServiceSettings, SettingsGroup, TopicPrefix, secret_in
from nena_shared.web.settings import HttpSettings


def _not_our_own(path: str) -> str:
    if path.split("/")[1:2] == ["v1"]:
        message = "/v1 is this program's own API"
        raise ValueError(message)
    return path


class StoreSettings(SettingsGroup):
    """Where orders are kept."""

    url: SecretStr = Field(
        SecretStr("sqlite:///nena-orders.db"),
        description="Database of the orders: sqlite:///FILE (four slashes for an absolute path), or "
        "postgresql://USER@HOST/DATABASE, with which a second order service stands by.",
    )
    url_file: Path | None = Field(
        None, description="File that holds store.url, where a password is in it; counts before it."
    )

    def location(self) -> str:
        """Return the database's URL, from the file where one is named; it may hold a password.

        Raises:
            ConfigurationError: the file cannot be read, or is empty.

        """
        return secret_in(self.url_file, "store.url_file") if self.url_file else self.url.get_secret_value()


class RoutingSettings(SettingsGroup):
    """What a way costs."""

    costs: list[CostKey] = Field(
        [CostKey.DISTANCE],
        min_length=1,
        description="Cost evaluators that are added up (docs/plant-models.md).",
    )


class OrderSettings(SettingsGroup):
    """What counts for orders that say nothing else."""

    on_failure: FailurePolicy = Field(
        (),
        description="What is done when a vehicle fails at an order that says nothing of that: measures that "
        'are tried in turn, such as [{"do": "RETRY", "times": 2}, {"do": "HOLD"}] (docs/order-service.md); '
        "empty: the order fails.",
    )


class EventSettings(SettingsGroup):
    """The event stream."""

    backlog: int = Field(
        1000,
        ge=1,
        description="Events that a client may be behind; above that it is brought up to date anew.",
    )
    replay_limit: int = Field(
        10_000, ge=0, description="Changed orders that a client that comes back is told of at most."
    )
    clients: int = Field(100, ge=1, description="Clients that may follow the event stream at a time.")


class HostSettings(SettingsGroup):
    """Hosts that ask over MQTT."""

    requests_per_second: float = Field(
        200.0, gt=0, description="Requests that one host may make over MQTT in the long run."
    )
    burst: int = Field(2000, ge=1, description="Requests that one host may make over MQTT at once.")


class OrderServiceSettings(ServiceSettings):
    """What the order service can be told."""

    plant: Path = Field(description="Plant model: openTCS's XML (0.0.2 to 7.0.0), LIF, or NeNa's own JSON.")
    routing: RoutingSettings = Field(default_factory=RoutingSettings, description="What a way costs.")
    orders: OrderSettings = Field(
        default_factory=OrderSettings, description="What counts for orders that say nothing else."
    )
    store: StoreSettings = Field(default_factory=StoreSettings, description="The store of the orders.")
    http: HttpSettings = Field(default_factory=lambda: HttpSettings(port=55200), description="The REST API.")
    public_url: HttpUrl | None = Field(
        None,
        description="Where hosts reach this order service: a standby sends them there while this one is the "
        "active one; none: http.host and http.port.",
    )
    events: EventSettings = Field(default_factory=EventSettings, description="The event stream.")
    opentcs_prefix: Annotated[str, AfterValidator(_not_our_own)] = Field(
        "/opentcs",
        pattern=r"^(/[A-Za-z0-9_.-]+)*$",
        description="Path before openTCS's web API, version 1, for orders and vehicles; empty: not served.",
    )
    topic_prefix: TopicPrefix = Field(
        "nena/v1", description="First levels of the MQTT topics for hosts; a prefix for each fleet."
    )
    hosts: HostSettings = Field(default_factory=HostSettings, description="Hosts that ask over MQTT.")
    interface_name: TopicPrefix = Field(
        "uagv", description="First levels of the topics of robots with VDA 5050 2.x."
    )
    interface_name_v3: TopicPrefix = Field(
        "vda5050", description="First levels of the topics of robots with VDA 5050 3.x."
    )
    fleet: FleetSettings = Field(
        default_factory=FleetSettings, description="How patient fleet control is with robots."
    )
    kernel: EngineSettings = Field(
        default_factory=EngineSettings, description="How orders and vehicles are handled."
    )
    end_kept: float = Field(
        60.0,
        ge=0,
        le=3600,
        description="Seconds that the end of an order stays retained at the broker for hosts that were away; "
        "then its topic is cleared.",
    )
    max_body: int = Field(
        262_144, ge=1024, description="Longest request body that either door takes, in bytes."
    )
