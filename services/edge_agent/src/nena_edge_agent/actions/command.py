"""The messages that begin, hold and end an action."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping

from pydantic import JsonValue

from nena_edge_agent.actions.background import WorkFailedError
from nena_edge_agent.actions.message_shape import Record
from nena_edge_agent.actions.ports import Publisher
from nena_edge_agent.actions.settings import CommandSettings, FieldValues
from nena_edge_agent.actions.values import ActionValues, MessageTemplate

LOOK_EVERY = 0.05
"""Seconds between two looks for a listener."""


class Command:
    """Publishes what the settings say, with the values of an action.

    Raises:
        ConfigurationError: no message of the type can be made of them.

    """

    def __init__(
        self,
        settings: CommandSettings,
        publisher: Publisher,
        shape: Record,
        values: ActionValues,
        path: str,
    ) -> None:
        self._settings = settings
        self._publisher = publisher

        def template(fields: FieldValues | None, name: str) -> MessageTemplate | None:
            return None if fields is None else MessageTemplate(fields, shape, values, f"{path}.{name}")

        self._begin = MessageTemplate(settings.fields, shape, values, f"{path}.fields")
        self._pause = template(settings.on_pause, "on_pause")
        self._resume = template(settings.on_resume, "on_resume")
        self._cancel = template(settings.on_cancel, "on_cancel")

    def check(self, values: Mapping[str, JsonValue]) -> None:
        """See whether every message can be made.

        Raises:
            FieldError: a value does not fit its field.

        """
        for each in (self._begin, self._pause, self._resume, self._cancel):
            if each:
                each.filled(values)

    async def heard(self) -> None:
        """Wait until somebody listens.

        Raises:
            WorkFailedError: nobody does.

        """
        patience = self._settings.listener_timeout
        for _ in range(int(patience / LOOK_EVERY)):
            if self._publisher.listeners:
                return
            await asyncio.sleep(LOOK_EVERY)
        if patience and not self._publisher.listeners:
            message = f"nobody listens to {self._settings.topic}"
            raise WorkFailedError(message)

    def begin(self, values: Mapping[str, JsonValue]) -> None:
        """Have it begin.

        Raises:
            RosError: there is no ROS session.
            FieldError: a value does not fit its field.

        """
        self._publisher.publish(self._begin.filled(values))

    def pause(self, values: Mapping[str, JsonValue]) -> None:
        """Have it hold; raises as :meth:`begin`."""
        self._send(self._pause, values)

    def resume(self, values: Mapping[str, JsonValue]) -> None:
        """Have it go on; raises as :meth:`begin`."""
        self._send(self._resume, values)

    def cancel(self, values: Mapping[str, JsonValue]) -> None:
        """Have it give up; raises as :meth:`begin`."""
        self._send(self._cancel, values)

    def _send(self, template: MessageTemplate | None, values: Mapping[str, JsonValue]) -> None:
        if template is not None:
            self._publisher.publish(template.filled(values))
