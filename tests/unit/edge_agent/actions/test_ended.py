from __future__ import annotations

from nena_edge_agent.actions.ended import ENDED
from nena_edge_agent.actions.plugin import RunningAction


def test_it_stands_where_a_running_action_may_stand() -> None:
    running: RunningAction = ENDED
    for step in (running.pause, running.resume, running.cancel):
        step()
