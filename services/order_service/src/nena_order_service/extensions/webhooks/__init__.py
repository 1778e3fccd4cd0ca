"""Web hooks: changed orders for hosts that cannot keep a connection open."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Mapping
from functools import partial
from typing import ClassVar

from pydantic import BaseModel, Field

from nena_order_service.api.operations import Handler
from nena_order_service.extension import Core, Extension
from nena_order_service.extensions.webhooks.delivery import HttpReceiver, Receiver, Webhook, read_secret
from nena_order_service.extensions.webhooks.settings import WebhookSettings
from nena_shared.fleet_api.operations.fleet import LIST_WEBHOOKS
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.fleet_api.webhooks import WebhookList
from nena_shared.metrics import Section, counter, gauge
from nena_shared.settings import ConfigurationError, TopLevelSettings


class WebhooksSettings(TopLevelSettings):
    """The web hooks."""

    webhooks: tuple[WebhookSettings, ...] = Field(
        (), max_length=20, description="Web hooks (docs/order-service.md)."
    )


class Webhooks(Extension):
    """Sends changed orders to each web hook of the settings, and serves ``/v1/webhooks``."""

    Settings: ClassVar[type[BaseModel]] = WebhooksSettings

    def __init__(self, settings: WebhooksSettings, core: Core) -> None:
        """Create them; raises ConfigurationError if a secret, a CA or the HTTP library is missing."""
        super().__init__(settings, core)
        names = [hook.name for hook in settings.webhooks]
        if len(set(names)) < len(names):
            raise ConfigurationError([f"webhooks: use each name once: {', '.join(sorted(names))}"])
        self.hooks: dict[Webhook, Receiver] = {
            Webhook(hook, read_secret(hook), core.store, core.clock): HttpReceiver(hook)
            for hook in settings.webhooks
        }

    def handlers(self) -> Iterable[Handler]:
        """Return what lists the web hooks."""
        return (
            Handler(LIST_WEBHOOKS, lambda: WebhookList(webhooks=tuple(hook.status for hook in self.hooks))),
        )

    def tasks(self) -> Mapping[str, Callable[[], Awaitable[None]]]:
        """Return a task for each web hook, so that an unreachable receiver does not delay the others."""
        return {
            f"web hook {hook.settings.name}": partial(hook.run, receiver)
            for hook, receiver in self.hooks.items()
        }

    def order_changed(self, _: TransportOrderStatus) -> None:
        """Wake all web hooks."""
        for hook in self.hooks:
            hook.wake()

    section: ClassVar[Section[Webhooks] | None] = Section(
        "Web hooks",
        (
            counter(
                "nena_order_service_webhook_messages_total",
                "Messages of web hooks: `delivered`, or given up (`dropped`).",
                lambda s: {
                    (hook.settings.name, result): count
                    for hook in s.hooks
                    for result, count in (("delivered", hook.delivered), ("dropped", hook.dropped))
                },
                "webhook",
                "result",
            ),
            gauge(
                "nena_order_service_webhook_retrying",
                "1 while the receiver of a web hook does not accept a message.",
                lambda s: {hook.settings.name: hook.is_failing for hook in s.hooks},
                "webhook",
            ),
        ),
    )
