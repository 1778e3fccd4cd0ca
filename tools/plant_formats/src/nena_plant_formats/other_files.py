"""Name files that are not plant models, and what to do with them."""

import re
from collections.abc import Collection
from typing import Any, Final

from nena_shared.findings import shortened

_REDRAW: Final = "draw its points and paths in openTCS's model editor, or export them as LIF"
_IMAGE: Final = "draw points and paths over it in openTCS's model editor, and save them as XML"
_MESSAGES: Final = "`nena vda5050 show` and `check` read recordings of messages"

_COMMENTS: Final = rb"(?:[ \t]*(?:#[^\n]*|---[^\n]*|%[^\n]*)?\r?\n)*"
_BY_TEXT: Final = (
    (rb"\Z", "an empty file; save or copy it again"),
    # PNM, PNG, JPEG, GIF, BMP, TIFF, WebP
    (rb"P[1-6]\s|\x89PNG|\xff\xd8\xff|GIF8|BM.{4}\0{4}|II\*\0|MM\0\*|RIFF.{4}WEBP", f"an image; {_IMAGE}"),
    (
        rb"PK\x03\x04",
        "a ZIP archive; unpack it, or open it in openTCS 4 if that saved it, and save it as XML",
    ),
    (rb"\x1f\x8b|BZh|\xfd7zXZ|7z\xbc\xaf|\x28\xb5\x2f\xfd", "a compressed file; unpack it"),
    (rb"(999\r?\n[^\n]*\n\s*)*0\r?\n\s*SECTION|AutoCAD Binary DXF|AC10\d\d", f"a CAD drawing; {_REDRAW}"),
    (rb"%PDF", f"a PDF document; {_REDRAW}"),
    (rb"#ROSBAG|\x89MCAP|SQLite format 3", f"a recording or a database; {_REDRAW}"),
    (rb"(?i:<!doctype html|<html)", "a web page; download the file that the page shows"),
    (rb"version https://git-lfs", "a pointer of Git LFS; fetch the file with `git lfs pull`"),
    # expat reads XML in UTF-16.
    (rb"\xff\xfe(?!<)|\xfe\xff(?!\0<)|[{\[]\0|\0[{\[]", "text in UTF-16; save it as UTF-8"),
    (rb"(?!<)(?=.*^image\s*:)(?=.*^resolution\s*:)", f"a map of Nav2's map_server (YAML); {_IMAGE}"),
    (rb"(?!<).*^(levels|building_name)\s*:", f"a building or navigation graph of Open-RMF (YAML); {_REDRAW}"),
    (rb"\{[^\n]*\"(topic|headerId)\"[^\n]*\}\s*\{", f"messages as JSON lines; {_MESSAGES}"),
    (
        _COMMENTS + rb"\[{0,2}[\w.\"-]+(\]{1,2}[ \t\r]*(#[^\n]*)?$|[ \t]*=)",
        "a settings file, such as NeNa's (TOML); its setting `plant` names the plant model",
    ),
    (_COMMENTS + rb"(?:- )?[\w/*.\"-]+[ \t]*:(\s|\Z)", f"a YAML file; {_REDRAW}"),
)
_API: Final = f"the description of an HTTP interface (OpenAPI), no plant; {_REDRAW}"
_BY_FIELDS: Final = (
    ({"openapi"}, _API),
    ({"swagger"}, _API),
    ({"type", "geometry"}, f"GeoJSON; {_REDRAW}"),
    ({"advancedPointList"}, f"a map of SEER's robots (smap); {_REDRAW}"),
    ({"levels"}, f"a building or site of Open-RMF; {_REDRAW}"),
    ({"topic", "payload"}, f"a recorded MQTT message; {_MESSAGES}"),
    ({"headerId"}, f"a message of VDA 5050; {_MESSAGES}"),
)
_HEAD: Final = 65_536
"""Bytes of a text that are looked at."""


def name_of(data: bytes, content: Any, known: Collection[str]) -> str | None:  # noqa: ANN401 - whatever the JSON holds
    """Return what a file is, and what to do with it; None for a text that is not recognised.

    ``content`` is what JSON holds, None if it is none; objects with one of the ``known`` fields are expected.
    """
    if content is None:
        head, flags = data[:_HEAD], re.DOTALL | re.MULTILINE
        return next((text for start, text in _BY_TEXT if re.match(start, head, flags)), None)
    first = content[0] if isinstance(content, list) and content else content
    if not isinstance(first, dict) or not first:
        return f"JSON without {'any fields' if isinstance(first, dict) else 'an object'}; {_REDRAW}"
    for fields, text in _BY_FIELDS:
        if fields <= first.keys():
            return text
    points = first.get("points")
    if isinstance(points, list) and points and isinstance(points[0], dict) and "position" in points[0]:
        return "a plant model of openTCS's web API; use the XML file that openTCS's model editor saves"
    if first is content and not first.keys().isdisjoint(known):
        return None
    return f"other JSON, with the fields {shortened(', '.join(map(repr, first)))}; {_REDRAW}"
