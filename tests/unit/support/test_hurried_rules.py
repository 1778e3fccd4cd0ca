"""What the tests of alerts change in the rules: durations, and nothing else."""

from __future__ import annotations

import re

from support.prometheus import CONFIGURATION, LONGEST_FOR, hurried

DURATION = re.compile(r"\b\d+[smh]\b(?!\w)")
RULES = sorted((CONFIGURATION / "rules").glob("*.yml"))


def test_only_durations_change() -> None:
    assert RULES
    for file in RULES:
        text = file.read_text(encoding="utf-8")
        assert DURATION.sub("?", hurried(text)) == DURATION.sub("?", text), file.name


def test_no_alert_waits_longer_than_the_limit_but_one() -> None:
    text = hurried((CONFIGURATION / "rules" / "alerts.yml").read_text(encoding="utf-8"))
    assert re.findall(rf"for: (?!(?:[1-{LONGEST_FOR}])s)(.*)", text) == ["5m"]


def test_windows_have_a_second_for_each_minute() -> None:
    rule = "      - alert: A\n        expr: a[15m] or b offset 1h > 900\n        for: 10m\n"
    assert hurried(rule) == "      - alert: A\n        expr: a[15s] or b offset 60s > 900\n        for: 8s\n"
