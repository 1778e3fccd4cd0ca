from __future__ import annotations

from typing import Any

import pytest
from pydantic import BaseModel
from pydantic_settings import EnvSettingsSource

from nena_shared.settings import load
from reference.configuration import BY_FILE, PROGRAMS, Setting, settings_of


@pytest.mark.parametrize("program", PROGRAMS)
def test_each_option_exists_in_its_program(program: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        load(PROGRAMS[program], ["--help"], program=program, description="")
    words = capsys.readouterr().out.replace(",", " ").split()

    assert [each.option for each in settings_of(PROGRAMS[program]) if each.option not in words] == []


@pytest.mark.parametrize("program", PROGRAMS)
def test_each_variable_exists_in_its_program(program: str, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = settings_of(PROGRAMS[program])
    for each in settings:
        monkeypatch.setenv(each.variable, f'"{each.name}"')

    read = EnvSettingsSource(PROGRAMS[program])()

    assert [each.name for each in settings if str(_at(read, each)).strip('"') != each.name] == []


def _at(read: dict[str, Any], setting: Setting) -> object:
    found: Any = read
    for part in setting.path:
        found = found[part]
    return found


@pytest.mark.parametrize("program", PROGRAMS)
def test_each_secret_can_be_read_from_a_file(program: str) -> None:
    settings = {each.name: each for each in settings_of(PROGRAMS[program])}

    assert [name for name, each in settings.items() if each.secret and name + BY_FILE not in settings] == []


def test_missing_descriptions_are_detected() -> None:
    class Bare(BaseModel):
        number: int = 1

    with pytest.raises(ValueError, match="number has no description"):
        settings_of(Bare)
