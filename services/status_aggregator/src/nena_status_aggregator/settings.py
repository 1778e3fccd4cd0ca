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
from nena_shared.web.oidc.settings import OidcSettings, ProtectedPlace
from nena_shared.web.settings import HttpSettings

_WRITTEN: Final = re.compile(r"([0-9]{1,3})/([0-9]{1,3})")


@dataclass(frozen=True, slots=True)
class Share:
    """Number ``number`` of ``of`` equal shares; each robot is in exactly one of them, always in the same."""

    number: int = 1
    of: int = 1

    @classmethod
    def read(cls, text: str) -> Self:
        """Read a share as people write it: ``2/3``.

        Raises:
            ValueError: it is none.

        """
        written = _WRITTEN.fullmatch(text)
        number, of = map(int, written.groups()) if written else (0, 0)
        if not 1 <= number <= of:
            message = f"{text!r} is no share; write 1/2 for the first of two, 2/2 for the second"
            raise ValueError(message)
        return cls(number, of)

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"

    def has(self, robot: RobotKey) -> bool:
        """Tell whether ``robot`` is in it: by a hash of its name, so that nobody has to agree on anything."""
        return self.of == 1 or crc32(str(robot).encode()) % self.of == self.number - 1


class PanelOidcSettings(OidcSettings):
    """Whose access tokens count, and how people get one at the panel."""

    client_id: str | None = Field(
        None, description="As what the issuer knows the panel; none: nobody signs in there by the issuer."
    )
    client_secret: SecretStr | None = Field(
        None, description="The panel's password at the issuer; none: a public client, by PKCE alone."
    )
    client_secret_file: Path | None = Field(None, description="File that holds the panel's password there.")
    panel_url: ProtectedPlace | None = Field(
        None,
        description="Where browsers have the panel, e.g. https://fleet.example/; the issuer is to send them "
        "back to api/v1/session/oidc/callback below it.",
    )
    scopes: tuple[str, ...] = Field(("openid", "profile"), description="What the panel asks the issuer for.")

    @model_validator(mode="after")
    def _together(self) -> Self:
        if (self.client_id is None) is not (self.panel_url is None):
            message = "client_id and panel_url belong together: give both, or none"
            raise ValueError(message)
        if "openid" not in self.scopes:
            message = "scopes: without openid it is no sign-in"
            raise ValueError(message)
        return self

    def secret(self) -> str | None:
        """Give the panel's password, from the file where one is named.

        Raises:
            ConfigurationError: the file cannot be read, or is empty.

        """
        if self.client_secret_file is not None:
            return secret_in(self.client_secret_file, "http.oidc.client_secret_file")
        return self.client_secret.get_secret_value() if self.client_secret else None


class AggregatorHttpSettings(HttpSettings):
    """Where page, API and metrics are."""

    port: int = Field(8080, ge=0, le=65535, description="TCP port to listen on; 0 takes a free one.")
    oidc: PanelOidcSettings | None = Field(
        None, description="An OpenID Connect issuer whose tokens count beside those of http.users."
    )


class EventSettings(SettingsGroup):
    """The event stream."""

    interval: float = Field(
        0.05, gt=0, le=5, description="Seconds over which changes are gathered into one event."
    )
    history: int = Field(
        1000, ge=1, description="Events kept, so that a client that lost its line can catch up."
    )
    backlog: int = Field(
        200, ge=1, description="Events that a client may be behind; above that it gets a new snapshot."
    )
    clients: int = Field(100, ge=1, description="Clients that may follow the event stream at a time.")


def _none_in_words(url: object) -> object:
    return None if isinstance(url, str) and url.lower() == "none" else url


class HistorySettings(SettingsGroup):
    """What happened to robots and orders."""

    url: Annotated[SecretStr | None, BeforeValidator(_none_in_words)] = Field(
        SecretStr("sqlite:///nena-history.db"),
        description="Database: sqlite:///FILE (four slashes for an absolute path), or "
        "postgresql+psycopg://USER@HOST/DATABASE; none: no history is kept.",
    )
    url_file: Path | None = Field(
        None, description="File that holds history.url, where a password is in it; counts before it."
    )
    retention_days: float = Field(30.0, gt=0, le=36500, description="Days that entries are kept.")
    track_days: float = Field(2.0, gt=0, le=36500, description="Days that positions are kept.")
    track_distance: float = Field(
        1.0, ge=0, description="Way after which a robot's position is kept, m; 0: positions are not."
    )
    queue_limit: int = Field(
        20_000, ge=1, description="Entries that may wait for the database; above that the oldest go."
    )
    batch_limit: int = Field(1000, ge=1, le=10_000, description="Entries that are written together.")
    interval: float = Field(0.5, gt=0, le=60, description="Seconds over which entries are gathered.")

    def location(self) -> str | None:
        """Give the database's URL, from the file where one is named; it may hold a password. None: none.

        Raises:
            ConfigurationError: the file cannot be read, or is empty.

        """
        if self.url_file:
            return secret_in(self.url_file, "history.url_file")
        return self.url.get_secret_value() if self.url else None


class OrderServiceSettings(SettingsGroup):
    """The order service, which carries out the commands of the control panel."""

    url: HttpUrl | None = Field(
        None, description="Its address, e.g. http://127.0.0.1:55200; none: the panel gives no commands."
    )
    timeout: float = Field(60.0, gt=0, le=600, description="Seconds that it has to answer a command.")
    ca: Path | None = Field(
        None, description="PEM file: who vouches for it where the system's certificates do not."
    )
    trusted_hosts: tuple[str, ...] = Field(
        ("127.0.0.1", "localhost", "::1"),
        description="Names and addresses under which browsers may reach this program to give commands.",
    )


def _share(text: str) -> str:
    return str(Share.read(text))


class AggregatorSettings(ServiceSettings):
    """The status aggregator."""

    http: AggregatorHttpSettings = Field(
        default_factory=AggregatorHttpSettings, description="Page, API and metrics."
    )
    interface_name: TopicPrefix = Field(
        "uagv", description="First levels of the topics of robots with VDA 5050 2.x."
    )
    interface_name_v3: TopicPrefix = Field(
        "vda5050", description="First levels of the topics of robots with VDA 5050 3.x."
    )
    topic_prefix: TopicPrefix = Field("nena/v1", description="Topic prefix of the order service's statuses.")
    share: Annotated[str, AfterValidator(_share)] = Field(
        "1/1",
        description="Which share of the robots it watches, where several aggregators divide them: 1/2 for "
        "the first of two.",
    )
    silence_limit: float | None = Field(
        None,
        gt=0,
        description="Seconds without a state after which a robot is silent; none: three of the intervals "
        "that its factsheet names, at least 35.",
    )
    clock_skew_limit: float = Field(
        2.0, gt=0, description="Seconds that a robot's clock may be off before it is shown."
    )
    robots_limit: int = Field(
        2000,
        ge=1,
        description="Robots that are kept; above that a silent one makes room, else new ones are refused.",
    )
    orders_limit: int = Field(
        1000, ge=1, description="Transport orders that are kept; the one that ended longest ago goes first."
    )
    events: EventSettings = Field(default_factory=EventSettings, description="The event stream.")
    history: HistorySettings = Field(default_factory=HistorySettings, description="The history.")
    order_service: OrderServiceSettings = Field(
        default_factory=OrderServiceSettings, description="Commands of the control panel."
    )
