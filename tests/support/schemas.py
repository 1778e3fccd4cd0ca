"""The official VDA 5050 schemas, with the corrections that make them agree with their text."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

from jsonschema_rs import Draft202012Validator, meta

from support.reference import reference_dir


def schema_problems(version: str, message: str, payload: bytes) -> list[str]:
    """Name what the official schema of ``message`` (``order``, ...) finds wrong with ``payload``."""
    folder = reference_dir("vda5050-schemas")
    return [error.message for error in _validator(folder, version, message).iter_errors(json.loads(payload))]


def official_schema(version: str, message: str) -> dict[str, Any]:
    """Return the official schema of ``message`` with its corrections."""
    return _corrected(reference_dir("vda5050-schemas"), version, message)


@cache
def _validator(folder: Path, version: str, message: str) -> Draft202012Validator:
    schema = _corrected(folder, version, message)
    meta.validate(schema)
    return Draft202012Validator(schema)


def _corrected(folder: Path, version: str, message: str) -> dict[str, Any]:
    corrections = json.loads((folder / "fixups.json").read_text(encoding="utf-8"))
    fixups = corrections.get(version, {"base": version, "files": {}})
    name = f"{message}.schema"
    if not (folder / fixups["base"]).is_dir():
        problem = f"no official schemas of VDA 5050 {version} in {folder}: add them, or a base to fixups.json"
        raise FileNotFoundError(problem)
    text = (folder / fixups["base"] / name).read_text(encoding="utf-8")
    schema: dict[str, Any] = json.loads(re.sub(r",(\s*[}\]])", r"\1", text))
    for operation in fixups["files"].get(name, []):
        _apply(schema, operation)
    return schema


def _apply(document: Any, operation: dict[str, Any]) -> None:
    """Do one operation of a JSON patch (RFC 6902), as far as the corrections need it."""
    parent, key = _locate(document, operation["path"])
    match operation["op"]:
        case "add" | "replace":
            parent[key] = operation["value"]
        case "remove":
            del parent[key]
        case "move":
            old_parent, old_key = _locate(document, operation["from"])
            parent[key] = old_parent.pop(old_key)
        case other:
            message = f"the corrections use {other!r}, which is not written here"
            raise ValueError(message)


def _locate(document: Any, pointer: str) -> tuple[Any, str]:
    *way, last = (part.replace("~1", "/").replace("~0", "~") for part in pointer.split("/")[1:])
    for part in way:
        document = document[part]
    return document, last
