"""From bytes to an element tree, within limits and without DTDs: plant models come from outside."""

from dataclasses import dataclass
from typing import Final
from xml.etree.ElementTree import Element, ParseError, TreeBuilder

from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import DefusedXMLParser

from nena_shared.plant.errors import ObjectKind, PlantModelError, Problem


@dataclass(frozen=True, slots=True)
class Limits:
    """What a file may hold at most."""

    size_bytes: int = 64 * 1024 * 1024
    depth: int = 16
    elements: int = 1_000_000


DEFAULT_LIMITS: Final = Limits()


class _LimitExceededError(Exception):
    """Stops the parser; the message says which limit was met."""


class _BoundedTreeBuilder(TreeBuilder):
    """Builds the tree while it counts, so that a hostile file stops before it has filled the memory."""

    def __init__(self, limits: Limits) -> None:
        super().__init__()
        self._limits = limits
        self._depth = 0
        self._elements = 0

    def start(self, tag: str, attrs: dict[str, str], /) -> Element:
        self._depth += 1
        self._elements += 1
        if self._depth > self._limits.depth:
            msg = f"elements are nested deeper than {self._limits.depth}"
            raise _LimitExceededError(msg)
        if self._elements > self._limits.elements:
            msg = f"there are more than {self._limits.elements} elements"
            raise _LimitExceededError(msg)
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> Element:
        self._depth -= 1
        return super().end(tag)


def parse(data: bytes, limits: Limits) -> Element:
    """Return the root element `model`; raises PlantModelError with one problem if there is none to be had."""
    if len(data) > limits.size_bytes:
        raise _refusal("LIMIT_EXCEEDED", f"the file has {len(data)} bytes, more than {limits.size_bytes}")
    parser = DefusedXMLParser(target=_BoundedTreeBuilder(limits), forbid_dtd=True)
    try:
        parser.feed(data)
        root: Element = parser.close()
    except _LimitExceededError as error:
        raise _refusal("LIMIT_EXCEEDED", str(error)) from None
    except DefusedXmlException as error:
        raise _refusal("FORBIDDEN_XML", f"DTDs and entities are not allowed: {error}") from error
    except (ParseError, LookupError, ValueError) as error:
        raise _refusal("MALFORMED_XML", f"this is no well-formed XML: {error}") from error
    if root.tag != "model":
        raise _refusal("NOT_A_PLANT_MODEL", f"the root element is {root.tag!r} instead of 'model'")
    return root


def _refusal(code: str, text: str) -> PlantModelError:
    return PlantModelError([Problem(code, ObjectKind.MODEL, "", text)])
