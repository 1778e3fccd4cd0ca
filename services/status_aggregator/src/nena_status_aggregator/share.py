"""The share of the robots that one of several aggregators watches."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final, Self
from zlib import crc32

from nena_shared.vda5050.topics import RobotKey

_WRITTEN: Final = re.compile(r"([0-9]{1,3})/([0-9]{1,3})")


@dataclass(frozen=True, slots=True)
class Share:
    """Number ``number`` of ``of`` equal shares; each robot is in exactly one of them, always in the same."""

    number: int = 1
    of: int = 1

    @classmethod
    def read(cls, text: str) -> Self:
        """Read a share as people write it: ``2/3``.

        Raises:
            ValueError: it is none.

        """
        written = _WRITTEN.fullmatch(text)
        number, of = map(int, written.groups()) if written else (0, 0)
        if not 1 <= number <= of:
            message = f"{text!r} is no share; write 1/2 for the first of two, 2/2 for the second"
            raise ValueError(message)
        return cls(number, of)

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"

    def has(self, robot: RobotKey) -> bool:
        """Tell whether ``robot`` is in it: by a hash of its name, so that nobody has to agree on anything."""
        return self.of == 1 or crc32(str(robot).encode()) % self.of == self.number - 1
