"""Epochs in retained statuses."""

from __future__ import annotations

import json

import pytest

from nena_shared.fleet_api.epoch import EpochFilter, epoch_of, with_epoch


def test_a_status_carries_its_epoch() -> None:
    body = with_epoch(b'{"name":"T-1"}', 7)
    assert json.loads(body) == {"name": "T-1", "epoch": 7}
    assert epoch_of(body) == 7


@pytest.mark.parametrize("body", [b"", b"{}", b"[1]", b'{"epoch":"x"}', b"\xff"])
def test_missing_epoch_counts_as_0(body: bytes) -> None:
    assert epoch_of(body) == 0


def test_older_epochs_are_ignored_once_a_newer_one_was_seen() -> None:
    epochs = EpochFilter()
    seen = [epochs.is_current(with_epoch(b'{"a":1}', each)) for each in (1, 2, 1, 2, 3, 2)]
    assert seen == [True, True, False, True, True, False]
    assert epochs.is_current(b"")
    assert epochs.ignored == 2
    epochs.reset()
    assert epochs.is_current(with_epoch(b'{"a":1}', 1))
