"""openTCS XML documents: bounded parsing, format versions, and typed access that collects findings."""

import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from enum import IntEnum, StrEnum
from math import isfinite, isnan
from types import MappingProxyType
from typing import Any, Final, TypeVar
from xml.etree.ElementTree import Element, ParseError, TreeBuilder

from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import DefusedXMLParser

from nena_plant_formats.exchange import refusal
from nena_shared.findings import letters_of
from nena_shared.plant.errors import ObjectKind, PlantModelError, PlantProblem


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of a file."""

    size_bytes: int = 64 * 1024 * 1024
    depth: int = 16
    elements: int = 1_000_000
    attributes: int = 1000
    """Attributes of one element; the parsing time is quadratic in their number."""


_LONG_TAG: Final = re.compile(rb"<[^<]{16384,}")
"""Matches text that may be an element's attributes; a tag contains no <."""


DEFAULT_LIMITS: Final = Limits()


class _LimitExceededError(Exception):
    """Stop parsing; the message names the limit."""


class _BoundedTreeBuilder(TreeBuilder):
    """Tree builder with limits; stops malicious files before they exhaust the memory."""

    def __init__(self, limits: Limits) -> None:
        super().__init__()
        self._limits = limits
        self._depth = 0
        self._elements = 0

    def start(self, tag: str, attrs: dict[str, str], /) -> Element:
        self._depth += 1
        self._elements += 1
        if self._depth > self._limits.depth:
            raise _LimitExceededError(f"elements are nested deeper than {self._limits.depth} levels")
        if self._elements > self._limits.elements:
            raise _LimitExceededError(f"the file has more than {self._limits.elements} elements")
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> Element:
        self._depth -= 1
        return super().end(tag)


def parse(data: bytes, limits: Limits) -> Element:
    """Parse a document and return its root element `model`; raises PlantModelError with one problem."""
    if len(data) > limits.size_bytes:
        raise refusal("LIMIT_EXCEEDED", f"the file has {len(data)} bytes; the limit is {limits.size_bytes}")
    if any(each.group().count(b"=") > limits.attributes for each in _LONG_TAG.finditer(data)):
        raise refusal("LIMIT_EXCEEDED", f"an element has more than {limits.attributes} attributes")
    if data.startswith(_BINARY_FORMATS):
        raise _old_format()
    # Plant models come from outside: an entity could read a file, or grow without bound.
    parser = DefusedXMLParser(target=_BoundedTreeBuilder(limits), forbid_dtd=True)
    try:
        parser.feed(_text_for_expat(data))
        root: Element = parser.close()
    except _LimitExceededError as error:
        raise refusal("LIMIT_EXCEEDED", str(error)) from None
    except DefusedXmlException as error:
        raise refusal("FORBIDDEN_XML", f"DTDs and entities are not allowed; remove them: {error}") from error
    # For an unknown encoding, expat raises LookupError; for one of several bytes, ValueError.
    except (ParseError, LookupError, ValueError) as error:
        text = f"neither JSON nor well-formed XML, or not in the encoding that it states: {error}"
        raise refusal("MALFORMED_XML", text) from error
    if root.tag in _EDITOR_ROOTS:
        raise _old_format()
    if root.tag != "model":
        text = (
            f"the root element is {root.tag!r}, not 'model'; use the file that openTCS's model editor saves"
        )
        raise refusal("NOT_A_PLANT_MODEL", text)
    return root


_DECLARED: Final = re.compile(
    rb"""<\?xml[^>]*encoding=["'](gb\d+|gbk|big5|shift_jis|euc-\w\w)["']""", re.IGNORECASE
)


def _text_for_expat(data: bytes) -> bytes | str:
    """Decode a text whose encoding expat cannot read or, after a byte order mark, would not believe."""
    declared = _DECLARED.match(data)
    encoding = (
        "utf-16" if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)) else declared and declared[1].decode()
    )
    return data.decode(encoding) if encoding else data


_BINARY_FORMATS: Final = b"\xac\xed\x00\x05"
"""First bytes of Java objects: models saved by openTCS's plant overview before it wrote XML."""

_EDITOR_ROOTS: Final = frozenset({"courseModel", "java", "object-stream"})
"""Root elements of the plant overview's own files (.opentcs), which are not plant models of the kernel."""


def _old_format() -> PlantModelError:
    text = (
        "this is a file of openTCS's plant overview from before it saved plant models as XML; open it in "
        f"openTCS 4 and save it as XML. Readable: {_READABLE}"
    )
    return refusal("OLD_OPENTCS_FORMAT", text)


_READABLE = "0.0.2, 0.0.3, 0.0.4, 0.0.5, 6.0.x and 7.0.x"
_NUMBERS = re.compile(r"v?(\d{1,9})(?:\.(\d{1,9}))?(?:\.(\d{1,9}))?", re.IGNORECASE)


class FormatVersion(IntEnum):
    """Format version; newer versions compare greater."""

    V0_0_2 = 2
    V0_0_3 = 3
    V0_0_4 = 4
    V0_0_5 = 5
    V6_0_0 = 60
    V7_0_0 = 70

    @property
    def is_old(self) -> bool:
        """Whether the format is older than 6.0.0, in which many attributes are optional."""
        return self < FormatVersion.V6_0_0

    @property
    def has_layout_elements(self) -> bool:
        """Whether the visualLayout holds all drawing data instead of the objects."""
        return self <= FormatVersion.V0_0_3

    @staticmethod
    def parse(text: str, model_name: str) -> "FormatVersion":
        """Parse a format version; raises PlantModelError if it is not supported."""
        numbers = _NUMBERS.fullmatch(text.strip())
        if numbers is not None:
            major, minor, patch = (int(number or 0) for number in numbers.groups())
            # Before 6.0.0, openTCS counted its formats by the last number: 0.0.2 to 0.0.5.
            wanted = 10 * major or patch
            fitting = (each for each in FormatVersion if each == wanted and each.is_old is not bool(major))
            if minor == 0 and (known := next(fitting, None)) is not None:
                return known
        raise PlantModelError(
            [
                PlantProblem(
                    "UNSUPPORTED_VERSION",
                    ObjectKind.MODEL,
                    model_name,
                    f"format version {text!r} is not supported; save the model in one of {_READABLE}",
                )
            ]
        )


@dataclass(slots=True)
class Findings:
    """Errors and warnings in order of their occurrence in a file of `version`."""

    version: FormatVersion
    errors: list[PlantProblem] = field(default_factory=list)
    warnings: list[PlantProblem] = field(default_factory=list)
    is_old: bool = field(init=False)
    """Whether the format is older than 6.0.0, in which many attributes are optional."""
    _ignored: Counter[tuple[ObjectKind, str]] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self.is_old = self.version.is_old

    def error(self, code: str, kind: ObjectKind, name: str, text: str) -> None:
        """Add an error: the model is rejected after it was read completely."""
        self.errors.append(PlantProblem(code, kind, name, text))

    def warn(self, code: str, kind: ObjectKind, name: str, text: str) -> None:
        """Add a warning: the model stays usable."""
        self.warnings.append(PlantProblem(code, kind, name, text))

    def ignore(self, kind: ObjectKind, what: str, times: int = 1) -> None:
        """Count ignored content, so that thousands of equal attributes cause one warning."""
        self._ignored[kind, what] += times

    def ignored(self) -> Iterator[PlantProblem]:
        """Yield one warning for each kind of ignored content."""
        for (kind, what), times in sorted(self._ignored.items()):
            yield PlantProblem("IGNORED", kind, "", f"{what} is ignored (found {times} times)")


T = TypeVar("T")
E = TypeVar("E", bound=StrEnum)

# int() alone accepts 1_000 as well.
INTEGER: Final = re.compile(r"[+-]?[0-9]{1,15}")
MAX_SCALE: Final = 1_000_000
COLOR: Final = re.compile(r"#[0-9A-Fa-f]{6}")
NONE_RENAMED: Final[Mapping[str, Any]] = MappingProxyType({})
# XML Schema's boolean has these four forms.
_BOOLEANS: Final = MappingProxyType({"true": True, "1": True, "false": False, "0": False})


class XmlObject:
    """Typed access to an element of a plant object. A missing attribute without a default is an error.

    After an error a harmless value is returned, so that a single run finds all errors.
    """

    __slots__ = ("_children", "_element", "_read", "findings", "kind", "name")

    def __init__(self, element: Element, kind: ObjectKind, name: str, findings: Findings) -> None:
        self._element = element
        self._read: set[str] = set()
        # By tag; elements are removed when read. Most elements have none.
        self._children: dict[str, list[Element]] = {}
        for child in element:
            self._children.setdefault(child.tag, []).append(child)
        self.kind = kind
        self.name = name
        self.findings = findings

    def has(self, attribute: str) -> bool:
        """Return whether the attribute exists."""
        return attribute in self._element.keys()  # noqa: SIM118 - an Element iterates over its children

    def if_old(self, value: T) -> T | None:
        """Return the value as default for formats before 6.0.0; newer ones require the attribute."""
        return value if self.findings.is_old else None

    def text(self, attribute: str, default: str | None = None) -> str:
        """Return the attribute unchanged."""
        value = self._read_value(attribute)
        if value is None and default is None:
            self._report_missing(attribute)
        # Not stripped: a name may end with a blank, and robots and orders use it as it is.
        return value or default or ""

    def optional_text(self, attribute: str) -> str | None:
        """Return the attribute, or None if it is missing or empty."""
        return self._read_value(attribute) or None

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
        value = self._read_value(attribute)
        if value is None:
            if default is None:
                self._report_missing(attribute)
            return fallback
        if INTEGER.fullmatch(value.strip().removesuffix(".0")) is None:
            return self._report_bad(attribute, "a whole number", fallback)
        number = int(value.strip().removesuffix(".0"))
        if (minimum is not None and number < minimum) or (maximum is not None and number > maximum):
            wanted = f"at least {minimum}" if maximum is None else f"between {minimum} and {maximum}"
            return self._report_bad(attribute, wanted, fallback)
        return number

    def scale(self, attribute: str, default: float) -> float:
        """Return a number above 0 and up to MAX_SCALE, which keeps products finite."""
        value = self._read_value(attribute)
        if value is None:
            return default
        number = _parse_float(value)
        if number is None or not 0 < number <= MAX_SCALE:
            return self._report_bad(attribute, f"a number above 0 and up to {MAX_SCALE}", default)
        return number

    def angle(self, attribute: str) -> float | None:
        """Return an angle in degrees; None if missing or `NaN`."""
        value = self._read_value(attribute)
        if value is None:
            return None
        number = _parse_float(value, nan=True)
        if number is None:
            return self._report_bad(attribute, "an angle in degrees or NaN", None)
        return None if isnan(number) else number

    def boolean(self, attribute: str, default: bool | None = None) -> bool:  # noqa: FBT001 - it is the value
        """Return a boolean, written `true` or `false` (or 1, 0)."""
        value = self._read_value(attribute)
        if value is None:
            if default is None:
                self._report_missing(attribute)
            return bool(default)
        if letters_of(value) not in _BOOLEANS:
            return self._report_bad(attribute, "'true' or 'false'", fallback=False)
        return _BOOLEANS[letters_of(value)]

    def choice(
        self,
        attribute: str,
        choices: type[E],
        default: E | None = None,
        *,
        renamed: Mapping[str, E] = NONE_RENAMED,
    ) -> E:
        """Return an enumeration value; `renamed` maps values of formats up to 0.0.4."""
        fallback = next(iter(choices)) if default is None else default
        value = self._read_value(attribute)
        if value is None:
            if default is None:
                self._report_missing(attribute)
            return fallback
        if value in renamed and self.findings.version <= FormatVersion.V0_0_4:
            self.warn("VALUE_REPLACED", f"{attribute} {value} of older formats is read as {renamed[value]}")
            return renamed[value]
        meant = next((each for each in choices if letters_of(each) == letters_of(value)), None)
        if meant is None:
            return self._report_bad(attribute, f"one of {', '.join(choices)}", fallback)
        if meant != value:
            self.warn("VALUE_REPLACED", f"{attribute} {value!r} is read as {meant}")
        return meant

    def color(self, attribute: str) -> str | None:
        """Return a colour `#RRGGBB`; drop anything else with a warning."""
        value = self._read_value(attribute)
        if value is None or COLOR.fullmatch(value):
            return value
        self.warn("DRAWING_DROPPED", f"{attribute} {value!r} is not a #RRGGBB colour; the default is used")
        return None

    def children(self, tag: str) -> Iterator["XmlObject"]:
        """Yield the child elements of this tag; findings on them carry this object's name."""
        for element in self._children.pop(tag, ()):
            child = XmlObject(element, self.kind, self.name, self.findings)
            yield child
            child.finish()

    def objects(self, tag: str, kind: ObjectKind) -> Iterator["XmlObject"]:
        """Yield the child elements that are plant objects with names of their own."""
        for element in self._children.pop(tag, ()):
            child = XmlObject(element, kind, element.get("name", ""), self.findings)
            if not child.text("name", default=""):
                child.error("MISSING_ATTRIBUTE", f"element {tag!r} needs a name")
            yield child
            child.finish()

    def properties(self) -> dict[str, str]:
        """Return the properties; for duplicate names the last value, with a warning."""
        found: dict[str, str] = {}
        for child in self.children("property"):
            key = child.text("name")
            if key in found:
                self.warn("DUPLICATE_PROPERTY", f"the property {key!r} is set twice; the last value is used")
            found[key] = child.text("value", default="")
        return found

    def finish(self) -> None:
        """Report attributes and children that were not read."""
        tag = self._element.tag
        for attribute, value in self._element.items():
            if value and attribute not in self._read:
                self.findings.ignore(self.kind, f"attribute {attribute!r} of element {tag!r}")
        for unread, elements in self._children.items():
            self.findings.ignore(self.kind, f"element {unread!r} in {tag!r}", len(elements))

    def error(self, code: str, text: str) -> None:
        """Report an error of this object."""
        self.findings.error(code, self.kind, self.name, text)

    def warn(self, code: str, text: str) -> None:
        """Report a warning about this object."""
        self.findings.warn(code, self.kind, self.name, text)

    def _read_value(self, attribute: str) -> str | None:
        self._read.add(attribute)
        return self._element.get(attribute)

    def _report_missing(self, attribute: str) -> None:
        others = [each for each in self._element.keys() if each not in self._read]  # noqa: SIM118 - no mapping
        # formats before 6.0.0 have xPosition for positionX
        similar = [each for each in others if sorted(letters_of(each)) == sorted(letters_of(attribute))]
        similar += get_close_matches(attribute, others, n=1, cutoff=0.9)
        hint = f"; {similar[0]!r} looks like it" if similar else ""
        self.error("MISSING_ATTRIBUTE", f"element {self._element.tag!r} needs attribute {attribute!r}{hint}")

    def _report_bad(self, attribute: str, wanted: str, fallback: T) -> T:
        written = self._element.get(attribute)
        self.error(
            "BAD_VALUE", f"{attribute} of element {self._element.tag!r} is {written!r}; it must be {wanted}"
        )
        return fallback


def _parse_float(text: str, *, nan: bool = False) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if isfinite(number) or (nan and isnan(number)) else None
