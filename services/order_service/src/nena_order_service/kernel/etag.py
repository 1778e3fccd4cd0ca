"""Entity tags (RFC 9110, 8.8.3): which version of an object a host has seen."""

from __future__ import annotations

from dataclasses import dataclass

ANY = "*"


@dataclass(frozen=True, slots=True)
class ETag:
    """The value of a header If-Match or If-None-Match: one tag, several with commas, or ``*`` for any."""

    value: str

    @classmethod
    def of(cls, version: int) -> ETag:
        """Make the tag of a version."""
        return cls(f'"{version}"')

    def fits(self, version: int) -> bool:
        """Tell whether this version is one of those that are named."""
        named = {part.strip().removeprefix("W/") for part in self.value.split(",")}
        return bool(named & {ANY, f'"{version}"'})

    def __str__(self) -> str:
        return self.value
