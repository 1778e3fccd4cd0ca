"""Settings of the order service."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from pydantic import Field, HttpUrl, SecretStr

from nena_order_service.engine.context import EngineSettings
from nena_order_service.fleet.settings import FleetSettings
from nena_order_service.routing.graph import CostKey
from nena_shared.fleet_api.transport_order import (
    FailureMeasure,
    FailurePolicy,
    FailureStep,
)
from nena_shared.settings import ServiceSettings, SettingsGroup, TopicPrefix, secret_in
from nena_shared.web.settings import HttpSettings

DISTRIBUTION: Final = "nena-order-service"


class StoreSettings(SettingsGroup):
    """The store of orders."""

    url: SecretStr = Field(
        SecretStr("sqlite:///nena-orders.db"),
        description="Database URL of the orders: sqlite:///FILE (four slashes for an absolute path) or "
        "postgresql://USER@HOST/DATABASE, which allows a standby.",
    )
    url_file: Path | None = Field(
        None, description="File with the database URL, for a URL with a password. Overrides store.url."
    )

    def location(self) -> str:
        """Return the database URL, read from the file if one is named; it may contain a password.

        Raises:
            ConfigurationError: the file cannot be read, or is empty.
        """
        return secret_in(self.url_file, "store.url_file") if self.url_file else self.url.get_secret_value()


class RoutingSettings(SettingsGroup):
    """Costs of routes."""

    costs: list[CostKey] = Field(
        [CostKey.DISTANCE],
        min_length=1,
        description="Cost evaluators; their costs are added (docs/plant-models.md).",
    )


class OrderSettings(SettingsGroup):
    """Defaults of orders."""

    on_failure: FailurePolicy = Field(
        (FailureStep(do=FailureMeasure.OTHER_VEHICLE, times=2),),
        description='Default failure policy: measures tried in turn, such as [{"do": "RETRY", "times": 2}, '
        '{"do": "HOLD"}] (docs/order-service.md). Empty: the order fails.',
    )


class EventSettings(SettingsGroup):
    """The event stream."""

    backlog: int = Field(
        1000,
        ge=1,
        description="Maximum number of events a client may be behind; beyond it, they receive a snapshot.",
    )
    replay_limit: int = Field(
        10_000, ge=0, description="Maximum number of changed orders replayed to a client that reconnects."
    )
    clients: int = Field(100, ge=1, description="Maximum number of event stream clients.")


class HostSettings(SettingsGroup):
    """Limits of hosts over MQTT."""

    requests_per_second: float = Field(
        200.0, gt=0, description="Sustained requests per second of one host over MQTT."
    )
    burst: int = Field(2000, ge=1, description="Burst of requests of one host over MQTT.")


class OrderServiceSettings(ServiceSettings):
    """The settings of the order service."""

    plant: Path = Field(description="Plant model file: openTCS XML (0.0.2 to 7.0.0), LIF, or NeNa JSON.")
    routing: RoutingSettings = Field(default_factory=RoutingSettings, description="Cost of routes.")
    orders: OrderSettings = Field(default_factory=OrderSettings, description="Defaults of orders.")
    store: StoreSettings = Field(default_factory=StoreSettings, description="Store of the orders.")
    http: HttpSettings = Field(default_factory=lambda: HttpSettings(port=55200), description="The REST API.")
    public_url: HttpUrl | None = Field(
        None,
        description="URL at which hosts reach this order service; a standby redirects them to it. Unset: "
        "http.host and http.port.",
    )
    events: EventSettings = Field(default_factory=EventSettings, description="The event stream.")
    topic_prefix: TopicPrefix = Field(
        "nena/v1", description="MQTT topic prefix for hosts; use one per fleet."
    )
    hosts: HostSettings = Field(default_factory=HostSettings, description="Limits of hosts over MQTT.")
    interface_name: TopicPrefix = Field(
        "uagv", description="Interface name (topic prefix) of robots with VDA 5050 2.x."
    )
    interface_name_v3: TopicPrefix = Field(
        "vda5050", description="Interface name (topic prefix) of robots with VDA 5050 3.x."
    )
    fleet: FleetSettings = Field(
        default_factory=FleetSettings, description="Fleet control: timeouts, retries and limits for robots."
    )
    engine: EngineSettings = Field(
        default_factory=EngineSettings, description="Orders, vehicles and traffic."
    )
    end_kept: float = Field(
        60.0,
        ge=0,
        le=3600,
        description=("Time an ended order stays retained at the broker, seconds; then its topic is cleared."),
    )
    max_body: int = Field(262_144, ge=1024, description="Maximum request body over REST and MQTT, bytes.")
