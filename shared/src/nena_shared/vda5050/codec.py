"""Codecs: decode and encode the version-neutral messages in one protocol version."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, TypeVar, cast

from pydantic import ValidationError
from pydantic_core import from_json

from nena_shared.vda5050.action import InstantActions
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.graph import violations
from nena_shared.vda5050.malformed import MalformedMessageError, problems_of, quoted, received_in
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.responses import Responses
from nena_shared.vda5050.rules import Rules
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.visualization import Visualization
from nena_shared.vda5050.zone_set import ZoneSetTransfer

M = TypeVar("M", bound=Header)

MAXIMUM_PAYLOAD = 4 * 1024 * 1024
"""Maximum size of a message, bytes."""

_UNIX_TIME: Final = re.compile(rb'"timestamp"\s*:\s*"\s*[\d.]+\s*"')
"""A Unix time as text, which pydantic reads as a time; the standard has ISO 8601 (section 7.2)."""

KINDS: Final[Mapping[Topic, type[Header]]] = MappingProxyType(
    {
        Topic.ORDER: Order,
        Topic.INSTANT_ACTIONS: InstantActions,
        Topic.STATE: State,
        Topic.VISUALIZATION: Visualization,
        Topic.CONNECTION: Connection,
        Topic.FACTSHEET: Factsheet,
        Topic.ZONE_SET: ZoneSetTransfer,
        Topic.RESPONSES: Responses,
    }
)
"""Neutral message class of each topic."""


@dataclass(frozen=True, slots=True)
class Codec:
    """Reads and writes the messages of one version; ``forms`` maps neutral messages to their forms."""

    version: str
    interface_name: str
    """First topic level (interface name) that the standard suggests."""
    forms: Mapping[type[Header], type[Header]]
    rules: Rules

    @property
    def major_version(self) -> str:
        """Topic level of the major version (section 4.2), e.g. ``v2``."""
        return "v" + self.version.split(".", 1)[0]

    @property
    def kinds(self) -> dict[Topic, type[Header]]:
        """Topics of this version with their neutral message classes (section 4.3)."""
        return {topic: kind for topic, kind in KINDS.items() if kind in self.forms}

    def decode(self, kind: type[M], payload: bytes) -> M:
        """Decode a message (section 7.1).

        Raises:
            MalformedMessageError: the message violates the schema or the graph rules, or has another major
                version.
        """
        if len(payload) > MAXIMUM_PAYLOAD:
            raise MalformedMessageError(kind.__name__, [f"longer than {MAXIMUM_PAYLOAD} bytes"])
        if kind not in self.forms:
            raise MalformedMessageError(kind.__name__, [f"{self.version} has no such message"])
        form = cast("type[M]", self.forms[kind])
        try:
            message = form.model_validate_json(payload, by_alias=True, by_name=False)
        except ValidationError as error:
            received = received_in(error, payload)
            raise MalformedMessageError(
                kind.__name__, problems_of(error), payload, received=received
            ) from error
        if _UNIX_TIME.search(payload):
            timestamp = from_json(payload).get("timestamp", "")
            if timestamp.strip().replace(".", "").isdigit():
                problem = "timestamp: is a Unix time, not ISO 8601"
                raise MalformedMessageError(kind.__name__, [problem], payload, received=quoted(timestamp))
        problems = list(violations(message)) if isinstance(message, Order) else []
        if message.version.split(".", 1)[0] != self.version.split(".", 1)[0]:
            problems.append(f"version: {message.version} is not of the same major version as {self.version}")
        if problems:
            raise MalformedMessageError(kind.__name__, problems, payload)
        return message

    def encode(self, message: Header) -> bytes:
        """Encode a message with this version's number, validated against this version's form.

        Raises:
            MalformedMessageError: an order violates the graph rules, or this version has no such message.
            ValidationError: this version cannot express the message.
        """
        return self.written(self.formed(message))

    def formed(self, message: Header) -> Header:
        """Return a message in this version's form, for :meth:`written`; raises as :meth:`encode`."""
        if isinstance(message, Order) and (problems := violations(message)):
            raise MalformedMessageError(Order.__name__, problems)
        form = self.forms[self._kind_of(message)]
        # the header's version is that of the format, whatever the sender of the neutral message had (7.2)
        if message.version != self.version:
            message = message.model_copy(update={"version": self.version})
        return form.from_neutral(message)

    def written(self, wire: Header) -> bytes:
        """Encode a message of this version's form."""
        # model_dump_json makes text first, to be encoded again
        return type(wire).__pydantic_serializer__.to_json(wire, by_alias=True, exclude_none=True)

    def _kind_of(self, message: Header) -> type[Header]:
        for kind in self.forms:
            if isinstance(message, kind):
                return kind
        raise MalformedMessageError(type(message).__name__, [f"{self.version} has no such message"])
