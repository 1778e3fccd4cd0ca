"""(r) CPU to read a state: strictly, tolerantly, and tolerantly with each reported deviation of the table.

CPU time of this process is measured, and of each kind the fastest turn counts, so that other programs on the
machine count little.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from statistics import median
from time import process_time
from typing import Any, Final

from bench.figures import within
from bench.state_cost import SCHEME, payload
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.message_reader import MessageReader
from nena_shared.vda5050.records import read_record
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.v2_1 import CODEC
from support.deviating_robots import DEVIATIONS

READS: Final = 20
"""Reads per turn."""
TURNS: Final = 25

CLEAN_AT_MOST: Final = 1.1
DEVIATING_AT_MOST: Final = 3.0
TOPIC: Final = SCHEME.of(RobotKey("Bench", "bench-000"), Topic.STATE)


def measure() -> dict[str, Any]:
    """Measure all kinds by turns, so that each sees the same machine; return ratios to strict reading."""
    clean = payload(0, 1)
    readers = {"strict": lambda: read_record(State, CODEC, clean), "clean": _tolerant(clean)}
    for each in DEVIATIONS:
        if each.topic is Topic.STATE and each.version == CODEC.version and each.fields and each.report:
            read = _tolerant(each.applied(clean))
            try:
                read()
            except MalformedMessageError:
                continue  # refused, so nothing is repaired
            readers[each.words] = read
    costs = dict.fromkeys(readers, inf)
    for _ in range(TURNS):
        for words, read in readers.items():
            costs[words] = min(costs[words], _cost(read))
    strict = costs.pop("strict")
    ratios = {words: round(cost / strict, 2) for words, cost in costs.items()}
    clean_ratio = ratios.pop("clean")
    return {
        "targets": {
            "clean": within(clean_ratio, CLEAN_AT_MOST),
            "deviating_median": within(median(ratios.values()), DEVIATING_AT_MOST),
        },
        "strict_us": round(strict, 1),
        "deviating": ratios,
    }


def _tolerant(message: bytes) -> Callable[[], State]:
    reader = MessageReader()
    return lambda: reader.read(State, TOPIC, message, "v2")


def _cost(read: Callable[[], object]) -> float:
    """Return the CPU per read, microseconds."""
    start = process_time()
    for _ in range(READS):
        read()
    return (process_time() - start) / READS * 1e6
