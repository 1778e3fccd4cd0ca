"""Web hooks: changed orders for hosts that cannot keep a connection open."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Mapping
from typing import Any, ClassVar

from pydantic import BaseModel, Field

from nena_order_service.api.operations import Handler
from nena_order_service.extension import Core, Extension
from nena_order_service.extensions.webhooks.orders import OrderWebhook, OrderWebhookSettings
from nena_shared.extensions.webhooks import check_names, section_of
from nena_shared.fleet_api.operations.fleet import LIST_WEBHOOKS
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.fleet_api.webhooks import WebhookList
from nena_shared.metrics import Section
from nena_shared.settings import TopLevelSettings


class WebhooksSettings(TopLevelSettings):
    """The web hooks."""

    webhooks: tuple[OrderWebhookSettings, ...] = Field(
        (), max_length=20, description="Web hooks (docs/order-service.md)."
    )


class Webhooks(Extension):
    """Sends changed orders to each web hook of the settings, and serves ``/v1/webhooks``."""

    Settings: ClassVar[type[BaseModel]] = WebhooksSettings

    def __init__(self, settings: WebhooksSettings, core: Core) -> None:
        """Create them; raises ConfigurationError if a secret, a CA or the HTTP library is missing."""
        super().__init__(settings, core)
        check_names(settings.webhooks)
        self.hooks = [OrderWebhook(hook, core.store, core.clock) for hook in settings.webhooks]

    def handlers(self) -> Iterable[Handler]:
        """Return what lists the web hooks."""
        return (
            Handler(LIST_WEBHOOKS, lambda: WebhookList(webhooks=tuple(hook.status for hook in self.hooks))),
        )

    def tasks(self) -> Mapping[str, Callable[[], Awaitable[None]]]:
        """Return a task for each web hook, so that an unreachable receiver does not delay the others."""
        return {f"web hook {hook.settings.name}": hook.run for hook in self.hooks}

    def order_changed(self, _: TransportOrderStatus) -> None:
        """Wake all web hooks."""
        for hook in self.hooks:
            hook.wake()

    section: ClassVar[Section[Any] | None] = section_of("nena_order_service")
