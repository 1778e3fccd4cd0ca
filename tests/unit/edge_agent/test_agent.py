from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from nena_edge_agent.journal import Recorder, Version
from nena_edge_agent.messages import RobotMessages
from nena_edge_agent.protocol.memory import Memory
from nena_shared.mqtt import Outbound
from nena_shared.vda5050.state import State
from support.restarts.life import live
from support.restarts.scenarios import SCENARIOS


def test_a_state_is_encoded_while_the_disk_writes_what_it_reports(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps: list[str] = []
    encode, write, sync = RobotMessages.state, Recorder.write, Recorder.sync

    def encoded(messages: RobotMessages, state: State, *, keep: bool) -> Outbound:
        steps.append("encode")
        return encode(messages, state, keep=keep)

    async def written(recorder: Recorder, version: Version, memory: Callable[[], Memory]) -> None:
        await write(recorder, version, memory)
        steps.append("write")

    async def synced(recorder: Recorder) -> None:
        steps.append("sync")
        await sync(recorder)

    monkeypatch.setattr(RobotMessages, "state", encoded)
    monkeypatch.setattr(Recorder, "write", written)
    monkeypatch.setattr(Recorder, "sync", synced)
    history = live(next(iter(SCENARIOS.values())), tmp_path)

    assert "write encode sync" in " ".join(steps)
    assert steps.count("encode") <= len(history.fleet.states) + 1  # none is encoded in vain
    ids = [each.header_id for each in history.fleet.states]
    assert ids == list(range(ids[0], ids[0] + len(ids)))
