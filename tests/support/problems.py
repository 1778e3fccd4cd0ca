"""Answers that are problems (RFC 9457)."""

from __future__ import annotations

import httpx

from nena_shared.fleet_api.transport_order import Problem


def problem(answer: httpx.Response, status: int) -> Problem:
    """Return the problem that an answer is: of this status, with a detail in a whole sentence."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    found = Problem.model_validate_json(answer.content)
    assert found.status == status
    assert found.detail.endswith(".")
    return found
