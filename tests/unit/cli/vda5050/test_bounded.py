"""What is remembered of a conversation without an end."""

from __future__ import annotations

from nena_cli.vda5050.bounded import Remembered


def test_the_oldest_is_forgotten_first() -> None:
    known: Remembered[str, int] = Remembered(2)
    for number, key in enumerate("abac"):
        known[key] = number

    assert dict(known) == {"b": 1, "c": 3}
