"""Damaged and hostile messages; equal for equal seeds."""

from __future__ import annotations

import json
from collections.abc import Callable
from random import Random
from typing import Any

from support.examples import FUZZ_SEED

VALUES: tuple[Any, ...] = (
    None,
    True,
    False,
    -1,
    0,
    2**31,
    2**63,
    10**400,
    -1.5,
    1e308,
    "",
    "x" * 100_000,
    "\u0000",
    "\ud800",
    "NaN",
    "../../etc/passwd",
    "#",
    "+/+/+",
    "2.1.0",
    "9.9.9",
    "1970-01-01T00:00:00.000Z",
    "9999-12-31T23:59:59.999Z",
    "INITIALIZING",
    [],
    {},
    [[]],
    [None],
    [1] * 10_000,
    {"actionId": "a", "actionType": "cancelOrder", "blockingType": "HARD"},
)
"""Values that replace those of a field."""

DEPTH = 100_000


def stream(name: str) -> Random:
    """Return the random generator of a test; FUZZ_SEED selects another one."""
    return Random(f"{FUZZ_SEED}{name}")


def damaged(payload: bytes, chance: Random) -> bytes:
    """Return a damaged ``payload``: cut, altered, inflated, or replaced."""
    return chance.choice(WAYS)(payload, chance)


def damaged_text(text: bytes, chance: Random) -> bytes:
    """Return a damaged text: cut, altered, in another encoding, or deeply nested."""
    return chance.choice((_cut, _bent, _bent, _other_encoding, _deep, _deep_toml))(text, chance)


def _cut(payload: bytes, chance: Random) -> bytes:
    return payload[: chance.randrange(len(payload) + 1)]


def _bent(payload: bytes, chance: Random) -> bytes:
    wrong = bytearray(payload)
    for _ in range(chance.randint(1, 4)):
        wrong[chance.randrange(len(wrong))] = chance.randrange(256)
    return bytes(wrong)


def _other_encoding(payload: bytes, chance: Random) -> bytes:
    text = payload.decode(errors="replace")
    return text.encode(chance.choice(["utf-16", "utf-32", "utf-8-sig", "cp037"]), errors="replace")


def _deep(_payload: bytes, chance: Random) -> bytes:
    return chance.choice([b"[", b'{"a":']) * DEPTH


def _deep_toml(_text: bytes, chance: Random) -> bytes:
    return b"a = " + chance.choice([b"[", b"{a = "]) * chance.choice([200, 600, DEPTH])


def _no_json(_payload: bytes, chance: Random) -> bytes:
    return chance.choice([b"", b"\x00", b"null", b"[]", b'"order"', b"NaN", b"-", chance.randbytes(200)])


def _replaced(payload: bytes, chance: Random) -> bytes:
    """Replace one value of the message, remove it, or repeat it."""
    message = json.loads(payload)
    spots = _spots(message)
    if not spots:
        return payload
    holder, key = chance.choice(spots)
    kind = chance.randrange(4)
    if kind == 0:
        del holder[key]
    elif kind == 1 and isinstance(holder, list):
        holder.insert(0, holder[key])
    elif kind == 2 and isinstance(holder, dict):
        holder[f"{key}x"] = holder.pop(key)
    else:
        holder[key] = chance.choice(VALUES)
    return json.dumps(message, ensure_ascii=chance.random() < 0.5).encode("utf-8", errors="surrogatepass")


def _replaced_much(payload: bytes, chance: Random) -> bytes:
    for _ in range(chance.randint(2, 6)):
        try:
            payload = _replaced(payload, chance)
        except ValueError:
            return payload
    return payload


def _as_it_was(payload: bytes, _chance: Random) -> bytes:
    """Repeat an old message: its header is outdated."""
    return payload


def _spots(value: Any) -> list[tuple[Any, Any]]:
    """Return all positions in a JSON value, as container and key."""
    if isinstance(value, dict):
        inside = list(value.items())
    elif isinstance(value, list):
        inside = list(enumerate(value))
    else:
        return []
    return [(value, key) for key, _ in inside] + [spot for _, each in inside for spot in _spots(each)]


WAYS: tuple[Callable[[bytes, Random], bytes], ...] = (
    _cut,
    _bent,
    _other_encoding,
    _deep,
    _no_json,
    _replaced,
    _replaced,
    _replaced,
    _replaced,
    _replaced_much,
    _replaced_much,
    _as_it_was,
)
