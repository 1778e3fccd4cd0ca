from __future__ import annotations

import pytest

from nena_order_service.api.operations import ETag


@pytest.mark.parametrize("value", ['"3"', "*", 'W/"3"', '"1", "3"', ' "3" '])
def test_tag_with_the_version_matches(value: str) -> None:
    assert ETag(value).fits(3)


@pytest.mark.parametrize("value", ["3", '"33"', "", '"1", "2"', "W/3"])
def test_any_other_tag_does_not_match(value: str) -> None:
    assert not ETag(value).fits(3)


def test_own_tag_matches_only_its_version() -> None:
    assert [version for version in range(5) if ETag.of(2).fits(version)] == [2]
