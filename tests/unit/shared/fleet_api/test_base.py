from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from nena_shared.fleet_api.base import IdempotencyKey, Moment, OrderName

MOMENT: TypeAdapter[datetime] = TypeAdapter(Moment)
KEY: TypeAdapter[str] = TypeAdapter(IdempotencyKey)
NAME: TypeAdapter[str] = TypeAdapter(OrderName)


@given(st.datetimes(timezones=st.just(UTC)))
def test_written_time_is_read_back_in_milliseconds(moment: datetime) -> None:
    read = MOMENT.validate_json(MOMENT.dump_json(moment))
    assert read == moment.replace(microsecond=moment.microsecond // 1000 * 1000)


@pytest.mark.parametrize("text", ["0001-01-01T00:00:00+14:00", "9999-12-31T23:59:59-14:00"])
def test_a_moment_that_has_no_time_in_utc_is_refused(text: str) -> None:
    with pytest.raises(ValidationError, match="in UTC"):
        MOMENT.validate_python(text)


@pytest.mark.parametrize(
    "digits", ['"20260101"', "20260101", '"2026"', '"20260101100000"', "1.5", '"-5"', "0"]
)
def test_digits_that_are_no_unix_time_of_today_are_refused(digits: str) -> None:
    with pytest.raises(ValidationError, match=r"ISO 8601, such as 2026-01-31T10:00:00Z"):
        MOMENT.validate_json(digits)


@pytest.mark.parametrize("same", ['"2026-01-01"', '"2026-01-01 00:00:00"', "1767225600", '"1767225600000"'])
def test_a_time_may_be_a_date_or_a_unix_time(same: str) -> None:
    assert MOMENT.validate_json(same) == datetime(2026, 1, 1, tzinfo=UTC)


@pytest.mark.parametrize("key", ["", "x" * 201, "a\0"])
def test_keys_that_no_store_can_keep_are_refused(key: str) -> None:
    assert KEY.validate_python("line\nÜ'\"") == "line\nÜ'\""
    with pytest.raises(ValidationError):
        KEY.validate_python(key)


@pytest.mark.parametrize("name", ["A", "TOrder-1.2:3_4", "x" * 100])
def test_names_of_orders(name: str) -> None:
    assert NAME.validate_python(name) == name


@pytest.mark.parametrize("name", ["", ".", "..", ".hidden", "x" * 101, "a/b", "a\n", "Ü"])
def test_names_that_no_topic_or_url_can_hold_are_refused(name: str) -> None:
    with pytest.raises(ValidationError):
        NAME.validate_python(name)
