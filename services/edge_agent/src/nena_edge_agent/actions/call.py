"""The service that an action calls."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import JsonValue

from nena_edge_agent.actions.background import WorkFailedError
from nena_edge_agent.actions.matching import matches, value_at
from nena_edge_agent.actions.message_shape import Record
from nena_edge_agent.actions.ports import ServiceClient
from nena_edge_agent.actions.settings import CallSettings, FieldValues
from nena_edge_agent.actions.values import ActionValues, MessageTemplate

SUCCESS = "success"
MESSAGE = "message"


class Call:
    """Calls what the settings say, with the values of an action, and judges the response.

    ``shapes`` are those of the request and the response.

    Raises:
        ConfigurationError: no request of the type can be made of them, or no response will ever do.

    """

    def __init__(
        self,
        settings: CallSettings,
        client: ServiceClient,
        shapes: tuple[Record, Record],
        values: ActionValues,
        path: str,
    ) -> None:
        request, response = shapes
        has = response.fields
        usual: FieldValues = {SUCCESS: True} if SUCCESS in has else {}
        expected = usual if settings.expect is None else settings.expect
        self._settings = settings
        self._client = client
        self._request = MessageTemplate(settings.fields, request, values, f"{path}.fields")
        self._expected = MessageTemplate(expected, response, values, f"{path}.expect", any_of=True)
        self._result = settings.result if settings.result is not None else MESSAGE if MESSAGE in has else ""

    def check(self, values: Mapping[str, JsonValue]) -> None:
        """See whether the request can be made.

        Raises:
            FieldError: a value does not fit its field.

        """
        self._request.filled(values)
        self._expected.filled(values)

    async def do(self, values: Mapping[str, JsonValue]) -> str | None:
        """Call it, and give the result.

        Raises:
            WorkFailedError: the response says that it has failed.
            RosError: there is none.
            FieldError: a value does not fit its field.

        """
        response = await self._client.call(
            self._request.filled(values), seconds=self._settings.response_timeout
        )
        result = value_at(response, self._result) if self._result else None
        text = None if result in (None, "") else str(result)
        if not matches(response, self._expected.filled(values)):
            message = text or f"{self._settings.service} says that it has failed"
            raise WorkFailedError(message)
        return text
