"""Settings of the status aggregator."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Self
from zlib import crc32

from pydantic import AfterValidator, BeforeValidator, Field, HttpUrl, SecretStr, model_validator

from nena_shared.settings import ServiceSettings, SettingsGroup, TopicPrefix, secret_in
from nena_shared.vda5050.topics import RobotKey
from nena_shared.web.settings import HttpSettings, OidcSettings, ProtectedPlace

_WRITTEN: Final = re.compile(r"([0-9]{1,3})/([0-9]{1,3})")


@dataclass(frozen=True, slots=True)
class Share:
    """Share ``number`` of ``of`` equal shares; each robot always belongs to the same one."""

    number: int = 1
    of: int = 1

    @classmethod
    def read(cls, text: str) -> Self:
        """Parse a share such as ``2/3``; raises ValueError if the text is not a share."""
        written = _WRITTEN.fullmatch(text)
        number, of = map(int, written.groups()) if written else (0, 0)
        if not 1 <= number <= of:
            raise ValueError(f"{text!r} is not a share; use 1/2 for the first of two, 2/2 for the second")
        return cls(number, of)

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"

    def has(self, robot: RobotKey) -> bool:
        """Return whether ``robot`` belongs to this share, by a hash of its name."""
        return self.of == 1 or crc32(str(robot).encode()) % self.of == self.number - 1


class PanelOidcSettings(OidcSettings):
    """OpenID Connect: accepted access tokens, and sign-in at the panel."""

    client_id: str | None = Field(
        None, description="OIDC client ID of the panel. Unset: no OIDC sign-in at the panel."
    )
    client_secret: SecretStr | None = Field(
        None, description="OIDC client secret of the panel. Unset: a public client with PKCE only."
    )
    client_secret_file: Path | None = Field(None, description="File with the OIDC client secret.")
    panel_url: ProtectedPlace | None = Field(
        None,
        description="Public URL of the panel, e.g. https://fleet.example/. Register "
        "api/v1/session/oidc/callback below it as redirect URI at the issuer.",
    )
    scopes: tuple[str, ...] = Field(("openid", "profile"), description="OIDC scopes that the panel requests.")

    @model_validator(mode="after")
    def _check_together(self) -> Self:
        if (self.client_id is None) is not (self.panel_url is None):
            raise ValueError("client_id and panel_url must be set together")
        if "openid" not in self.scopes:
            raise ValueError("scopes must contain openid")
        return self

    def secret(self) -> str | None:
        """Return the client secret, from the file if one is set.

        Raises:
            ConfigurationError: the file cannot be read, or is empty.
        """
        if self.client_secret_file is not None:
            return secret_in(self.client_secret_file, "http.oidc.client_secret_file")
        return self.client_secret.get_secret_value() if self.client_secret else None


class AggregatorHttpSettings(HttpSettings):
    """HTTP server of panel, API and metrics."""

    port: int = Field(8080, ge=0, le=65535, description="TCP port to listen on; 0 for any free port.")
    oidc: PanelOidcSettings | None = Field(
        None, description="OpenID Connect issuer whose tokens are accepted in addition to http.users."
    )


class EventSettings(SettingsGroup):
    """The event stream."""

    interval: float = Field(
        0.05, gt=0, le=5, description="Interval between events, seconds; changes in between are merged."
    )
    history: int = Field(1000, ge=1, description="Number of events kept for clients that reconnect.")
    backlog: int = Field(
        200,
        ge=1,
        description="Maximum number of events a client may be behind; beyond it, they receive a snapshot.",
    )
    clients: int = Field(100, ge=1, description="Maximum number of event stream clients.")


def _none_in_words(url: object) -> object:
    return None if isinstance(url, str) and url.lower() == "none" else url


class HistorySettings(SettingsGroup):
    """The history of robots and orders."""

    url: Annotated[SecretStr | None, BeforeValidator(_none_in_words)] = Field(
        SecretStr("sqlite:///nena-history.db"),
        description="Database URL: sqlite:///FILE (four slashes for an absolute path) or "
        "postgresql+psycopg://USER@HOST/DATABASE; none disables the history.",
    )
    url_file: Path | None = Field(
        None, description="File with the database URL, for a URL with a password. Overrides history.url."
    )
    retention_days: float = Field(30.0, gt=0, le=36500, description="Retention of entries, days.")
    track_days: float = Field(2.0, gt=0, le=36500, description="Retention of positions, days.")
    track_distance: float = Field(
        1.0, ge=0, description="Distance between recorded positions of a robot, m; 0 disables recording."
    )
    queue_limit: int = Field(
        20_000,
        ge=1,
        description="Maximum number of entries waiting for the database; beyond it, the oldest are dropped.",
    )
    batch_limit: int = Field(1000, ge=1, le=10_000, description="Maximum number of entries per transaction.")
    interval: float = Field(0.5, gt=0, le=60, description="Interval between writes, seconds.")

    def location(self) -> str | None:
        """Return the database URL (may hold a password), from the file if set; None without a history.

        Raises:
            ConfigurationError: the file cannot be read, or is empty.
        """
        if self.url_file:
            return secret_in(self.url_file, "history.url_file")
        return self.url.get_secret_value() if self.url else None


class JamSettings(SettingsGroup):
    """Limits above which waiting robots are reported as a jam."""

    robots: int = Field(
        3, ge=0, description="Queue length (robots behind one vehicle) above which a jam is reported."
    )
    seconds: float = Field(
        60.0,
        ge=0,
        le=86400,
        description="Time that a queue must exceed `jam.robots` before a jam is reported, seconds.",
    )


class OrderServiceSettings(SettingsGroup):
    """Access to the order service, which executes the control panel's commands."""

    url: HttpUrl | None = Field(
        None,
        description="URL of the order service, e.g. http://127.0.0.1:55200. Unset: no commands in the panel.",
    )
    timeout: float = Field(60.0, gt=0, le=600, description="Timeout of a command, seconds.")
    direct_stop: bool = Field(
        default=True,
        description="Whether *Stop all* pauses the robots without the order service if that does not answer "
        "within 2 s. Set false if the order service requires a login and this aggregator does not.",
    )
    ca: Path | None = Field(
        None, description="CA bundle (PEM) for the order service. Unset: the system CA store."
    )
    trusted_hosts: tuple[str, ...] = Field(
        ("127.0.0.1", "localhost", "::1"),
        description="Host names and addresses in the browser under which commands are accepted.",
    )


def _share_text(text: str) -> str:
    return str(Share.read(text))


class AggregatorSettings(ServiceSettings):
    """The status aggregator."""

    http: AggregatorHttpSettings = Field(
        default_factory=AggregatorHttpSettings, description="HTTP server of panel, API and metrics."
    )
    interface_name: TopicPrefix = Field(
        "uagv", description="Interface name (topic prefix) of robots with VDA 5050 2.x."
    )
    interface_name_v3: TopicPrefix = Field(
        "vda5050", description="Interface name (topic prefix) of robots with VDA 5050 3.x."
    )
    topic_prefix: TopicPrefix = Field(
        "nena/v1", description="Prefix of NeNa's own topics, as in the order service and the edge agents."
    )
    share: Annotated[str, AfterValidator(_share_text)] = Field(
        "1/1",
        description="Share of the robots that this aggregator monitors, e.g. 1/2 for the first of two "
        "aggregators.",
    )
    silence_limit: float | None = Field(
        None,
        gt=0,
        description="Time without a state after which a robot is silent, seconds. Unset: three state "
        "intervals of its factsheet, at least 35.",
    )
    clock_skew_limit: float = Field(
        2.0, gt=0, description="Minimum clock deviation of a robot that is reported, seconds."
    )
    strict: bool = Field(
        default=False,
        description="Reject robot messages that violate VDA 5050 instead of repairing them.",
    )
    robots_limit: int = Field(
        10_000,
        ge=1,
        description="Maximum number of robots; beyond it, a new robot replaces a silent one or is ignored.",
    )
    messages_per_second: float = Field(
        200.0,
        gt=0,
        description="Sustained messages per second on each topic of a robot; every 10 kB count as one. "
        "Others are ignored.",
    )
    messages_burst: int = Field(2000, ge=1, description="Burst of messages on each topic of a robot.")
    orders_limit: int = Field(
        1000,
        ge=1,
        description="Maximum number of transport orders; beyond it, the one that ended first is removed.",
    )
    open_orders_limit: int = Field(
        10_000,
        ge=1,
        description="Maximum number of orders that have not ended, if more than orders_limit; beyond it, the "
        "one that has not changed for the longest time is removed.",
    )
    jam: JamSettings = Field(
        default_factory=JamSettings, description="Limits above which waiting robots are reported as a jam."
    )
    events: EventSettings = Field(default_factory=EventSettings, description="The event stream.")
    history: HistorySettings = Field(default_factory=HistorySettings, description="The history.")
    order_service: OrderServiceSettings = Field(
        default_factory=OrderServiceSettings,
        description="The order service, which executes the commands of the control panel.",
    )
