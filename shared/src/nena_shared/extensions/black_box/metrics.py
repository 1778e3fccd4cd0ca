"""The metrics of the recordings of a program."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from nena_shared.extensions.black_box.counts import RecordingCounts
from nena_shared.metrics import Metric, counter, gauge

S = TypeVar("S")


def recording_metrics(counts: Callable[[S], RecordingCounts | None]) -> tuple[Metric[S], ...]:
    """Return the metrics of recordings; ``counts`` returns None for a program that makes none."""
    return (
        counter(
            "nena_recordings_total",
            "Recordings and log reports: `written`, `not_written` because the disk failed, `sent` to the "
            "status aggregator, `refused` by it. Absent without a black box and upload.",
            lambda s: found.outcomes if (found := counts(s)) else None,
            "outcome",
        ),
        counter(
            "nena_recordings_sent_bytes_total",
            "Size of the recordings that were sent.",
            lambda s: found.sent_bytes if (found := counts(s)) else None,
        ),
        gauge(
            "nena_recordings_waiting",
            "Recordings that wait for their transfer to the status aggregator.",
            lambda s: found.waiting if (found := counts(s)) else None,
        ),
    )
