"""A conversation as a whole: answers to requests, and commands that the broker has kept."""

from __future__ import annotations

from dataclasses import replace

import pytest

from nena_cli.vda5050.finding import Rule
from nena_shared.vda5050.request import RequestStatus, ZoneRequest, ZoneRequestType
from support.talk import Talk
from support.zones import responses

REQUEST = ZoneRequest(
    request_id="r",
    request_type=ZoneRequestType.ACCESS,
    zone_id="z",
    zone_set_id="s",
    request_status=RequestStatus.REQUESTED,
)


@pytest.mark.parametrize(("request_id", "rules"), [("r", []), ("q", [Rule.RESPONSE])])
def test_fleet_control_answers_what_it_was_asked(request_id: str, rules: list[Rule]) -> None:
    talk = Talk().state("n0", of="", zone_requests=(REQUEST,)).state("n0", of="")

    assert talk.say(responses(request_id, "GRANTED")).rules == rules


def test_an_answer_to_what_was_not_heard_may_be_right() -> None:
    assert Talk().say(responses("r", "GRANTED")).rules == []


def test_a_command_that_the_broker_has_kept_is_of_another_time() -> None:
    talk = Talk().order("n3", "n4", first=6, update=4)
    talk.entries = [replace(each, retain=True) for each in talk.entries]
    for _ in range(4):
        talk.state("n0", of="")

    assert talk.findings == []
