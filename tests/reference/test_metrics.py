from __future__ import annotations

import re

from reference.metrics import PROGRAMS, metrics

NAME = re.compile(r"nena_[a-z0-9_]+")


def test_each_metric_has_a_valid_name_and_a_help_text() -> None:
    for each in metrics():
        assert NAME.fullmatch(each.name), each.name
        assert each.name.endswith("_total") is (each.kind == "counter"), each.name
        assert each.text.endswith("."), each.name


def test_names_are_unique_in_each_program() -> None:
    for program, sections in PROGRAMS.items():
        names = [each.name for section in sections for each in section.metrics]
        assert len(names) == len(set(names)), program
