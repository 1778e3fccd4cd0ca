from __future__ import annotations

import pytest

from nena_order_service.api.host_requests import ETag


@pytest.mark.parametrize("value", ['"3"', "*", 'W/"3"', '"1", "3"', ' "3" '])
def test_tag_that_names_the_version_fits(value: str) -> None:
    assert ETag(value).fits(3)


@pytest.mark.parametrize("value", ["3", '"33"', "", '"1", "2"', "W/3"])
def test_any_other_does_not(value: str) -> None:
    assert not ETag(value).fits(3)


def test_own_tag_fits_its_version_alone() -> None:
    assert [version for version in range(5) if ETag.of(2).fits(version)] == [2]
