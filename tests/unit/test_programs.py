"""What all programs have in common."""

from __future__ import annotations

import re
from importlib.metadata import entry_points

import pytest

PROGRAMS = {each.name: each for each in entry_points(group="console_scripts") if each.name.startswith("nena")}


def test_all_programs_are_known() -> None:
    assert PROGRAMS.keys() >= {"nena", "nena-edge-agent", "nena-demo-peripheral"}


@pytest.mark.parametrize("option", ["-V", "--version"])
@pytest.mark.parametrize("name", sorted(PROGRAMS))
def test_each_program_shows_its_version(
    name: str, option: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    program = PROGRAMS[name]
    monkeypatch.setattr("sys.argv", [name, option])
    monkeypatch.setenv("PYTHONHASHSEED", "0")  # or nena-simulate would replace this process
    with pytest.raises(SystemExit) as ended:
        program.load()()
    assert ended.value.code in (0, None)
    assert program.dist is not None
    assert capsys.readouterr().out == f"{name} {program.dist.version}\n"


def test_a_setting_named_version_keeps_its_option(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    agent = PROGRAMS["nena-edge-agent"]
    monkeypatch.setattr("sys.argv", [agent.name, "--version", "9.9.9"])
    assert agent.load()() == 2
    assert re.search(r"version.*9\.9\.9", capsys.readouterr().err)
