"""A journal that an earlier agent wrote, kept as a file: every later agent goes on with it.

The file was written at commit aace3a2, ``record.json`` shows what is in it. A new field of the memory needs a
default, not a new file; a change that this test refuses needs a new format and a way to read the old one.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from nena_edge_agent.journal import Journal
from nena_edge_agent.protocol.memory import Memory
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.versions import RULES
from support.robot_core import Bench

FOLDER = Path(__file__).parents[2] / "fixtures/journals/format-1"
RECORD = json.loads((FOLDER / "record.json").read_text(encoding="utf-8"))


def kept(folder: Path) -> Memory:
    shutil.copy(FOLDER / "ACME.0001.journal", folder)
    memory = Journal(folder, RobotKey("ACME", "0001")).read()
    assert memory is not None
    return memory


def test_a_journal_of_the_first_format_is_read_as_it_was_written(tmp_path: Path) -> None:
    assert json.loads(kept(tmp_path).model_dump_json(exclude_defaults=True)) == RECORD


def test_the_robot_continues_the_restored_order(tmp_path: Path) -> None:
    bench = Bench(memory=kept(tmp_path), ready=False, rules=RULES["3.0.0"], frame="hall: 1 2 0.5")

    assert json.loads(bench.core.memory().model_dump_json(exclude_defaults=True)) == RECORD
    assert (bench.state.order_id, bench.nodes) == ("second", ["n2", "n3", "n4"])
    assert bench.statuses() == {"w": "PAUSED", "lamp": "INITIALIZING", "p": "WAITING", "h": "WAITING"}
    assert bench.core.own_goals is not None
    assert bench.core.own_goals.goal_ids == ("g1",)
    assert [each.load_id for each in bench.state.loads or ()] == ["box-1"]
