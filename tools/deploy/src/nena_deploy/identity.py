"""Who connects to the broker: each with a certificate, whose common name is its user name there."""

from __future__ import annotations

import re
from enum import StrEnum

from pydantic import BaseModel, ConfigDict

LEVEL = re.compile(r"(?! )[^\x00-\x1f\x7f/+#.$][^\x00-\x1f\x7f/+#]{0,63}(?<! )")
"""What may be one level of a topic, and the name of a folder; brokers drop blanks at the ends of names in an
access list, so that the rights would be somebody else's."""


COMMON_NAME = 64
"""Bytes in UTF-8 that the common name of a certificate may have."""


class IdentityError(Exception):
    """An identity cannot be made, found or removed; the text says why."""


class Kind(StrEnum):
    """What an identity may do at the broker."""

    ROBOT = "robot"
    """Its own topics, as VDA 5050 gives them to a robot."""
    HOST = "host"
    """Asks for transport orders under its own name, and sees orders and vehicles."""
    ORDER_SERVICE = "order-service"
    STATUS_AGGREGATOR = "status-aggregator"


class Identity(BaseModel):
    """One that connects to the broker."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    kind: Kind
    name: str
    """At the broker: ``manufacturer/serialNumber`` of a robot."""
    certificate: int
    """Serial number of the certificate that counts."""

    @property
    def folder(self) -> str:
        """Where its files are, below the site's folder."""
        return self.kind if self.kind not in (Kind.ROBOT, Kind.HOST) else f"{self.kind}s/{self.name}"


def robot_name(manufacturer: str, serial_number: str) -> str:
    """Give a robot's user name at the broker.

    Raises:
        IdentityError: it could not stand in a topic.

    """
    return _short(f"{_level('manufacturer', manufacturer)}/{_level('serial number', serial_number)}")


def host_name(name: str) -> str:
    """Give a host's user name at the broker.

    Raises:
        IdentityError: it could not stand in a topic.

    """
    if name in {Kind.ORDER_SERVICE, Kind.STATUS_AGGREGATOR}:
        message = f"{name} is a service's name; a host of that name would have its rights."
        raise IdentityError(message)
    return _short(_level("name", name))


def _short(name: str) -> str:
    if len(name.encode(errors="replace")) > COMMON_NAME:
        message = (
            f"{name} is too long: a certificate holds {COMMON_NAME} letters, fewer of those beyond ASCII."
        )
        raise IdentityError(message)
    return name


def _level(what: str, text: str) -> str:
    if not LEVEL.fullmatch(text):
        message = (
            f"The {what} {text!r} cannot stand in a topic: 1 to 64 signs, none of / + #, no dot or $ first, "
            "no blank at an end."
        )
        raise IdentityError(message)
    return text
