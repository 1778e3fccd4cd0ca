"""Typed access to the attributes of an element; each fault becomes a note with the object's name."""

import re
from collections.abc import Iterator, Mapping
from enum import StrEnum
from math import isfinite, isnan
from types import MappingProxyType
from typing import Any, Final, TypeVar
from xml.etree.ElementTree import Element

from nena_shared.plant.errors import ObjectKind
from nena_shared.plant.opentcs_xml.format_version import FormatVersion
from nena_shared.plant.opentcs_xml.notes import Notes

T = TypeVar("T")
E = TypeVar("E", bound=StrEnum)

INTEGER: Final = re.compile(r"[+-]?[0-9]{1,15}")
MAX_SCALE: Final = 1_000_000
COLOR: Final = re.compile(r"#[0-9A-Fa-f]{6}")
NONE_RENAMED: Final[Mapping[str, Any]] = MappingProxyType({})
_BOOLEANS: Final = MappingProxyType({"true": True, "1": True, "false": False, "0": False})


class XmlObject:
    """An element that belongs to a plant object. A missing attribute without a default is an error.

    After an error a harmless value is returned, so that reading goes on and finds all errors at once.
    """

    __slots__ = ("_children", "_element", "_read", "kind", "name", "notes")

    def __init__(self, element: Element, kind: ObjectKind, name: str, notes: Notes) -> None:
        self._element = element
        self._read: set[str] = set()
        # By tag; what has been read is taken out. Most elements have none.
        self._children: dict[str, list[Element]] = {}
        for child in element:
            self._children.setdefault(child.tag, []).append(child)
        self.kind = kind
        self.name = name
        self.notes = notes

    def has(self, attribute: str) -> bool:
        """Whether the attribute is there."""
        return attribute in self._element.keys()  # noqa: SIM118 - an Element iterates over its children

    def if_old(self, value: T) -> T | None:
        """Return the value as a default for formats before 6.0.0 only; newer ones need the attribute."""
        return value if self.notes.is_old else None

    def text(self, attribute: str, default: str | None = None) -> str:
        """Return the attribute exactly as it is written."""
        value = self._value(attribute)
        if value is None and default is None:
            self._missing(attribute)
        return value or default or ""

    def optional_text(self, attribute: str) -> str | None:
        """Return the attribute, or None if it is missing or empty."""
        return self._value(attribute) or None

    def integer(
        self,
        attribute: str,
        default: int | None = None,
        *,
        minimum: int | None = None,
        maximum: int | None = None,
    ) -> int:
        """Return a whole number within the bounds."""
        fallback = minimum or 0 if default is None else default
        value = self._value(attribute)
        if value is None:
            if default is None:
                self._missing(attribute)
            return fallback
        if INTEGER.fullmatch(value.strip()) is None:
            return self._bad(attribute, "a whole number", fallback)
        number = int(value)
        if (minimum is not None and number < minimum) or (maximum is not None and number > maximum):
            wanted = f"at least {minimum}" if maximum is None else f"between {minimum} and {maximum}"
            return self._bad(attribute, wanted, fallback)
        return number

    def scale(self, attribute: str, default: float) -> float:
        """Return a number above 0 and up to MAX_SCALE, so that what is multiplied by it stays finite."""
        value = self._value(attribute)
        if value is None:
            return default
        number = _float(value)
        if number is None or not 0 < number <= MAX_SCALE:
            return self._bad(attribute, f"a number above 0 and up to {MAX_SCALE}", default)
        return number

    def angle(self, attribute: str) -> float | None:
        """Return an angle in degrees; a missing one and `NaN` give None."""
        value = self._value(attribute)
        if value is None:
            return None
        number = _float(value, nan=True)
        if number is None:
            return self._bad(attribute, "an angle in degrees or NaN", None)
        return None if isnan(number) else number

    def boolean(self, attribute: str, default: bool | None = None) -> bool:  # noqa: FBT001 - it is the value
        """Return a truth value, written `true` or `false` (or 1, 0)."""
        value = self._value(attribute)
        if value is None:
            if default is None:
                self._missing(attribute)
            return bool(default)
        if value not in _BOOLEANS:
            return self._bad(attribute, "'true' or 'false'", fallback=False)
        return _BOOLEANS[value]

    def choice(
        self,
        attribute: str,
        choices: type[E],
        default: E | None = None,
        *,
        renamed: Mapping[str, E] = NONE_RENAMED,
    ) -> E:
        """Return a value of an enumeration; `renamed` are values that only formats up to 0.0.4 have."""
        fallback = next(iter(choices)) if default is None else default
        value = self._value(attribute)
        if value is None:
            if default is None:
                self._missing(attribute)
            return fallback
        if value in renamed and self.notes.version <= FormatVersion.V0_0_4:
            self.warn("VALUE_REPLACED", f"{attribute} {value} of older formats is read as {renamed[value]}")
            return renamed[value]
        try:
            return choices(value)
        except ValueError:
            return self._bad(attribute, f"one of {', '.join(choices)}", fallback)

    def color(self, attribute: str) -> str | None:
        """Return a colour `#RRGGBB`; anything else is dropped with a warning, for it is only drawn."""
        value = self._value(attribute)
        if value is None or COLOR.fullmatch(value):
            return value
        self.warn("DRAWING_DROPPED", f"{attribute} {value!r} is no colour #RRGGBB; the default is used")
        return None

    def children(self, tag: str) -> Iterator["XmlObject"]:
        """Yield the child elements of this tag; notes on them carry this object's name."""
        for element in self._children.pop(tag, ()):
            child = XmlObject(element, self.kind, self.name, self.notes)
            yield child
            child.finish()

    def objects(self, tag: str, kind: ObjectKind) -> Iterator["XmlObject"]:
        """Yield the child elements that are plant objects of their own, each under its own name."""
        for element in self._children.pop(tag, ()):
            child = XmlObject(element, kind, element.get("name", ""), self.notes)
            if not child.text("name", default=""):
                child.error("MISSING_ATTRIBUTE", "every object needs a name")
            yield child
            child.finish()

    def properties(self) -> dict[str, str]:
        """Return the properties; of two with one name the last counts, with a warning."""
        found: dict[str, str] = {}
        for child in self.children("property"):
            key = child.text("name")
            if key in found:
                self.warn("DUPLICATE_PROPERTY", f"property {key!r} is there twice; the last value is used")
            found[key] = child.text("value", default="")
        return found

    def finish(self) -> None:
        """Note the attributes and children that nobody has read."""
        tag = self._element.tag
        for attribute, value in self._element.items():
            if value and attribute not in self._read:
                self.notes.ignore(self.kind, f"attribute {attribute!r} of element {tag!r}")
        for unread, elements in self._children.items():
            self.notes.ignore(self.kind, f"element {unread!r} in {tag!r}", len(elements))

    def error(self, code: str, text: str) -> None:
        """Note an error of this object."""
        self.notes.error(code, self.kind, self.name, text)

    def warn(self, code: str, text: str) -> None:
        """Note a warning on this object."""
        self.notes.warn(code, self.kind, self.name, text)

    def _value(self, attribute: str) -> str | None:
        self._read.add(attribute)
        return self._element.get(attribute)

    def _missing(self, attribute: str) -> None:
        self.error("MISSING_ATTRIBUTE", f"element {self._element.tag!r} needs attribute {attribute!r}")

    def _bad(self, attribute: str, wanted: str, fallback: T) -> T:
        written = self._element.get(attribute)
        self.error(
            "BAD_VALUE", f"{attribute} of element {self._element.tag!r} is {written!r}, it must be {wanted}"
        )
        return fallback


def _float(text: str, *, nan: bool = False) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if isfinite(number) or (nan and isnan(number)) else None
