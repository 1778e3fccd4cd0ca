"""The versions of openTCS's plant model format that can be read."""

import re
from enum import IntEnum
from types import MappingProxyType
from typing import Final

from nena_shared.plant.errors import ObjectKind, PlantModelError, Problem

_READABLE = "0.0.2, 0.0.3, 0.0.4, 0.0.5, 6.0.x and 7.0.x"
_NUMBERS = re.compile(r"(\d{1,9})\.(\d{1,9})\.(\d{1,9})")


class FormatVersion(IntEnum):
    """A version of the format; newer versions compare greater."""

    V0_0_2 = 2
    V0_0_3 = 3
    V0_0_4 = 4
    V0_0_5 = 5
    V6_0_0 = 60
    V7_0_0 = 70

    @property
    def is_old(self) -> bool:
        """Whether this is a format before 6.0.0, in which many attributes may be missing."""
        return self < FormatVersion.V6_0_0

    @property
    def has_layout_elements(self) -> bool:
        """Whether all drawing data stands in the visualLayout instead of at the objects."""
        return self <= FormatVersion.V0_0_3

    @staticmethod
    def parse(text: str, model_name: str) -> "FormatVersion":
        """Return the version that a file names; raises PlantModelError for one that is not readable."""
        numbers = _NUMBERS.fullmatch(text)
        if numbers is not None:
            major, minor, patch = (int(number) for number in numbers.groups())
            known = _MAJORS.get(major) if major else _PATCHES.get(patch)
            if minor == 0 and known is not None:
                return known
        raise PlantModelError(
            [
                Problem(
                    "UNSUPPORTED_VERSION",
                    ObjectKind.MODEL,
                    model_name,
                    f"format version {text!r} cannot be read; save the model in one of {_READABLE}",
                )
            ]
        )


_MAJORS: Final = MappingProxyType({6: FormatVersion.V6_0_0, 7: FormatVersion.V7_0_0})
_PATCHES: Final = MappingProxyType(
    {
        2: FormatVersion.V0_0_2,
        3: FormatVersion.V0_0_3,
        4: FormatVersion.V0_0_4,
        5: FormatVersion.V0_0_5,
    }
)
