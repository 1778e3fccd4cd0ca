"""The message that an action waits for."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping

from pydantic import JsonValue

from nena_edge_agent.actions.background import WorkFailedError
from nena_edge_agent.actions.matching import matches, value_at
from nena_edge_agent.actions.message_shape import Record
from nena_edge_agent.actions.ports import Fields, RosPort, TopicQos
from nena_edge_agent.actions.settings import AnswerSettings, FieldValues
from nena_edge_agent.actions.values import ActionValues, MessageTemplate

Progress = Callable[[str], None]


class Answer:
    """Listens to a topic, and ends the waiting of those whose answer has come.

    Raises:
        ConfigurationError: no message of the type will ever do.
        RosError: there is no such type.

    """

    def __init__(
        self, settings: AnswerSettings, port: RosPort, shape: Record, values: ActionValues, path: str
    ) -> None:
        def template(fields: FieldValues | None, name: str) -> MessageTemplate | None:
            if fields is None:
                return None
            return MessageTemplate(fields, shape, values, f"{path}.{name}", any_of=True)

        self._settings = settings
        self._match = MessageTemplate(settings.match, shape, values, f"{path}.match", any_of=True)
        self._failed = template(settings.failed, "failed")
        self._progress = template(settings.progress, "progress")
        self._waiting: dict[int, Callable[[Fields], None]] = {}
        self._last: Fields | None = None
        port.subscribe(settings.topic, settings.type, self._heard, qos=settings.qos)

    @property
    def words(self) -> str:
        """What is waited for, for people."""
        return f"waits for {self._settings.topic}"

    def check(self, values: Mapping[str, JsonValue]) -> None:
        """See whether a message can ever do.

        Raises:
            FieldError: a value does not fit its field.

        """
        for each in (self._match, self._failed, self._progress):
            if each:
                each.filled(values)

    def expect(self, values: Mapping[str, JsonValue], progress: Progress) -> asyncio.Future[str | None]:
        """Give what the answer will end: with the result, or a WorkFailedError.

        Of what came before, the last message counts where the topic is latched, and else none.
        """
        answered: asyncio.Future[str | None] = asyncio.get_running_loop().create_future()
        match = self._match.filled(values)
        failed = self._failed.filled(values) if self._failed else None
        going_on = self._progress.filled(values) if self._progress else None

        def look(message: Fields) -> None:
            if answered.done():
                return
            text = self._result(message)
            if failed is not None and matches(message, failed):
                reason = text or f"{self._settings.topic} says that it has failed"
                answered.set_exception(WorkFailedError(reason))
            elif matches(message, match):
                answered.set_result(text)
            elif going_on is not None and matches(message, going_on):
                progress(text or self.words)

        self._waiting[id(answered)] = look
        answered.add_done_callback(lambda _: self._waiting.pop(id(answered), None))
        if self._last is not None and self._settings.qos is TopicQos.LATCHED:
            look(self._last)
        return answered

    def _result(self, message: Fields) -> str | None:
        value = value_at(message, self._settings.result) if self._settings.result else None
        return None if value in (None, "") else str(value)

    def _heard(self, message: Fields) -> None:
        self._last = message
        for look in list(self._waiting.values()):
            look(message)
