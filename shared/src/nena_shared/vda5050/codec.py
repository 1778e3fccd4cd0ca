"""Between the version-neutral messages and the bytes of one protocol version."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar, cast

from pydantic import ValidationError

from nena_shared.vda5050.base import Header
from nena_shared.vda5050.graph import violations
from nena_shared.vda5050.malformed import MalformedMessageError, problems_of
from nena_shared.vda5050.order import Order

M = TypeVar("M", bound=Header)

MAXIMUM_PAYLOAD = 4 * 1024 * 1024
"""Bytes; a longer message is malformed."""


@dataclass(frozen=True, slots=True)
class Codec:
    """Reads and writes the messages of one version; ``forms`` gives each neutral message its form there."""

    version: str
    forms: Mapping[type[Header], type[Header]]

    @property
    def major_version(self) -> str:
        """The topic level of the version, e.g. ``v2``."""
        return "v" + self.version.split(".", 1)[0]

    def decode(self, kind: type[M], payload: bytes) -> M:
        """Read a message.

        Raises:
            MalformedMessageError: it breaks the schema or the graph rules, or has another major version.

        """
        if len(payload) > MAXIMUM_PAYLOAD:
            raise MalformedMessageError(kind.__name__, [f"longer than {MAXIMUM_PAYLOAD} bytes"])
        form = cast("type[M]", self.forms[kind])
        try:
            message = form.model_validate_json(payload, by_alias=True, by_name=False)
        except ValidationError as error:
            raise MalformedMessageError(kind.__name__, problems_of(error), payload) from error
        if problems := self._rule_problems(message):
            raise MalformedMessageError(kind.__name__, problems, payload)
        return message

    def encode(self, message: Header) -> bytes:
        """Write a message, checked against this version's form, under this version's number.

        Raises:
            MalformedMessageError: an order breaks the graph rules.
            ValidationError: the message cannot be said in this version.

        """
        kind = next(neutral for neutral in self.forms if isinstance(message, neutral))
        if isinstance(message, Order) and (problems := violations(message)):
            raise MalformedMessageError(kind.__name__, problems)
        wire = self.forms[kind].from_neutral(message.model_copy(update={"version": self.version}))
        return wire.model_dump_json(by_alias=True, exclude_none=True).encode()

    def _rule_problems(self, message: Header) -> list[str]:
        problems = list(violations(message)) if isinstance(message, Order) else []
        if message.version.split(".", 1)[0] != self.version.split(".", 1)[0]:
            problems.append(f"version: {message.version} is not of the same major version as {self.version}")
        return problems
