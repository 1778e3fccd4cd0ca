"""Settings of web hooks."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field, HttpUrl

from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.settings import SettingsGroup


class WebhookSettings(SettingsGroup):
    """A web hook: a URL that receives changed orders."""

    name: str = Field(
        pattern=r"^[A-Za-z0-9_.-]{1,100}$", description="Name; what the receiver has is stored under it."
    )
    url: HttpUrl = Field(description="URL that receives the messages by POST.")
    secret_file: Path = Field(
        description="File with the key of the signatures: `whsec_` and 24 to 64 bytes in base64."
    )
    ca: Path | None = Field(None, description="CA bundle (PEM) for the receiver. Unset: the system CA store.")
    states: tuple[TransportOrderState, ...] = Field(
        (), description="Send only orders in these states. Empty: every change of an order."
    )
    retry_hours: float = Field(
        24.0, gt=0, le=720, description="Time after which an undeliverable message is given up, hours."
    )
