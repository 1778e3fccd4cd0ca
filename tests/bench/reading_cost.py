"""CPU to read a state: strictly, tolerantly, and tolerantly with each deviation of the table, by turns.

``PYTHONPATH=tests python -m bench.reading_cost`` prints it. CPU time of this process is measured, so other
programs on the machine count little, and of each kind the fastest turn counts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from time import process_time
from typing import Final

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


@dataclass(frozen=True, slots=True)
class ReadingCost:
    """Microseconds of CPU per state: strict (the yardstick), tolerant, and tolerant if it deviates."""

    strict: float
    clean: float
    deviating: dict[str, float]

    def __str__(self) -> str:
        ratios = {words: cost / self.strict for words, cost in self.deviating.items()}
        worst = max(ratios, key=lambda words: ratios[words])
        return (
            f"strict {self.strict:.0f} µs, clean {self.clean / self.strict:.2f} times that, deviating "
            f"{median(ratios.values()):.2f} times in the median and {ratios[worst]:.2f} at most ({worst})"
        )


def measure(turns: int = TURNS, reads: int = READS) -> ReadingCost:
    """Measure all kinds by turns, so that each sees the same machine; return the minimum of each."""
    clean = payload(0, 1)
    readers = {"strict": lambda: read_record(State, CODEC, clean), "clean": _tolerant(clean)}
    for each in DEVIATIONS:
        if each.topic is Topic.STATE and each.version == CODEC.version and each.fields:
            read = _tolerant(each.applied(clean))
            try:
                read()
            except MalformedMessageError:
                continue  # refused, so nothing is repaired
            readers[each.words] = read
    costs: dict[str, list[float]] = {words: [] for words in readers}
    for _ in range(turns):
        for words, read in readers.items():
            costs[words].append(_cost(read, reads))
    found = {words: min(each) for words, each in costs.items()}
    return ReadingCost(found.pop("strict"), found.pop("clean"), found)


def _tolerant(message: bytes) -> Callable[[], State]:
    reader = MessageReader()
    return lambda: reader.read(State, TOPIC, message, "v2")


def _cost(read: Callable[[], object], reads: int) -> float:
    start = process_time()
    for _ in range(reads):
        read()
    return (process_time() - start) / reads * 1e6


if __name__ == "__main__":
    print(measure())  # noqa: T201 - the result
