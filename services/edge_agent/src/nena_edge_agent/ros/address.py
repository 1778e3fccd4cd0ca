"""Where in the ROS graph a robot is: its namespace and its domain."""

from __future__ import annotations

from typing import Self

from pydantic import ConfigDict, ValidationError
from pydantic.dataclasses import dataclass as checked

from nena_edge_agent.ros.settings import DomainId, Namespace, RosSettings


class BadAddressError(Exception):
    """There is no such place in a ROS graph; the text says what is wrong."""


@checked(frozen=True, config=ConfigDict(strict=True))
class RosAddress:
    """A namespace with its leading slash, and a domain id."""

    namespace: Namespace
    domain_id: DomainId

    @classmethod
    def of(cls, settings: RosSettings) -> Self:
        """Give the address that settings name."""
        return cls(settings.namespace, settings.domain_id)

    def changed(self, *, namespace: str | None = None, domain_id: int | None = None) -> RosAddress:
        """Give an address with what is given in place of its own.

        Raises:
            BadAddressError: ROS knows no such namespace or domain.

        """
        try:
            return RosAddress(
                namespace=self.namespace if namespace is None else namespace,
                domain_id=self.domain_id if domain_id is None else domain_id,
            )
        except ValidationError as error:
            problems = (f"{each['loc'][-1]}: {each['msg']}" for each in error.errors())
            raise BadAddressError("; ".join(problems)) from None

    def applied(self, settings: RosSettings) -> RosSettings:
        """Give ``settings`` with this address."""
        return settings.model_copy(update={"namespace": self.namespace, "domain_id": self.domain_id})

    def __str__(self) -> str:
        """Tell it to people."""
        return f"namespace {self.namespace}, domain {self.domain_id}"
