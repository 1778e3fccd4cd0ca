from __future__ import annotations

import gc

import pytest

from nena_shared.plant.paused_collector import paused_collector


def _fail_while_it_rests() -> None:
    assert not gc.isenabled()
    raise LookupError


def test_the_collector_rests_inside_and_goes_on_after_an_error_too() -> None:
    assert gc.isenabled()
    with pytest.raises(LookupError), paused_collector():
        _fail_while_it_rests()
    assert gc.isenabled()


def test_one_that_was_off_stays_off() -> None:
    gc.disable()
    try:
        with paused_collector():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()
