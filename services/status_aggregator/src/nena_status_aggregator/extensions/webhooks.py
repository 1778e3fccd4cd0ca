"""Web hooks: what needs a person, for programs that send messages to people."""

from __future__ import annotations

from collections import deque
from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import Any, ClassVar, Final

from pydantic import BaseModel, Field

from nena_shared.clock import Clock
from nena_shared.extensions.webhooks import Message, Webhook, WebhookSettings, check_names, section_of
from nena_shared.fleet_api.attention import Matter, MatterChange, MatterKind
from nena_shared.metrics import Section
from nena_shared.settings import TopLevelSettings
from nena_status_aggregator.extension import Core, Extension

WAITING: Final = 1000
"""Maximum number of messages that wait for a receiver; beyond it, the oldest is dropped."""


class AttentionWebhookSettings(WebhookSettings):
    """A web hook: a URL that receives what needs a person."""

    retry_hours: float = Field(
        1.0, gt=0, le=720, description="Time after which an undeliverable message is given up, hours."
    )
    kinds: tuple[MatterKind, ...] = Field((), description="Send only matters of these kinds. Empty: all.")


class WebhooksSettings(TopLevelSettings):
    """The web hooks."""

    webhooks: tuple[AttentionWebhookSettings, ...] = Field(
        (), max_length=20, description="Web hooks of the attention list (docs/panel.md)."
    )


class AttentionWebhook(Webhook):
    """Delivers each change of the attention list; what waits is lost at a restart."""

    def __init__(self, settings: AttentionWebhookSettings, clock: Clock) -> None:
        """Create it; raises ConfigurationError if its secret is unusable."""
        super().__init__(settings, clock)
        self._kinds = settings.kinds
        self._waiting: deque[Message] = deque()
        self._number = 0

    def add(self, change: MatterChange, matter: Matter) -> None:
        """Queue a change."""
        if self._kinds and matter.kind not in self._kinds:
            return
        if len(self._waiting) >= WAITING:
            self._waiting.popleft()
            self.dropped += 1
        self._number += 1
        kind = f"attention.{change.value}"
        self._waiting.append(Message(self._number, kind, matter.id, self._clock.now(), matter))
        self.wake()

    async def read(self) -> Sequence[Message]:
        """Return the oldest message."""
        return [*self._waiting][:1]

    def note_done(self, message: Message) -> None:
        """Remove it, unless it was dropped meanwhile."""
        if self._waiting and self._waiting[0] is message:
            self._waiting.popleft()


class Webhooks(Extension):
    """Sends each change of the attention list to each web hook of the settings."""

    Settings: ClassVar[type[BaseModel]] = WebhooksSettings
    section: ClassVar[Section[Any] | None] = section_of("nena")

    def __init__(self, settings: WebhooksSettings, core: Core) -> None:
        """Create them; raises ConfigurationError if a secret or a CA is unusable."""
        super().__init__(settings, core)
        check_names(settings.webhooks)
        self.hooks = [AttentionWebhook(hook, core.clock) for hook in settings.webhooks]

    def tasks(self) -> Mapping[str, Callable[[], Awaitable[None]]]:
        """Return a task for each web hook, so that an unreachable receiver does not delay the others."""
        return {f"web hook {hook.settings.name}": hook.run for hook in self.hooks}

    def on_matter(self, change: MatterChange, matter: Matter) -> None:
        """Queue it for all web hooks."""
        for hook in self.hooks:
            hook.add(change, matter)
