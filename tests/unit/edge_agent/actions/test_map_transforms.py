from __future__ import annotations

from nena_edge_agent.__main__ import make_registry
from nena_edge_agent.actions.map_transforms import MapTransforms
from nena_edge_agent.factsheet import make_capabilities, make_factsheet
from nena_edge_agent.loopback.control import SimulationControl
from nena_edge_agent.protocol.events import ActionReport
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.vda5050.action import Action, ActionStatus, BlockingType
from nena_shared.vda5050.own_actions import SHOW_MAP_TRANSFORMS, transforms_itself
from support.robot_core import HEADER


def test_the_transforms_are_told_by_map() -> None:
    told: list[ActionReport] = []
    action = Action(action_type=SHOW_MAP_TRANSFORMS, action_id="1", blocking_type=BlockingType.NONE)
    running = MapTransforms({"roof": "x=1", "hall": "scale=2"}).start(action, (), told.append)
    assert told == [ActionReport("1", ActionStatus.FINISHED, "hall: scale=2; roof: x=1")]
    for step in (running.pause, running.resume, running.cancel):
        step()
    assert len(told) == 1


def declares(**fields: object) -> bool:
    settings = EdgeAgentSettings.model_validate(fields)
    capabilities = make_capabilities(settings, make_registry(settings, SimulationControl()))
    return transforms_itself(make_factsheet(HEADER, settings, capabilities))


def test_the_factsheet_says_that_the_robot_transforms_itself_where_it_does() -> None:
    transforms = {"hall": "rotation=90"}
    for version in ("2.0.0", "2.1.0", "3.0.0"):
        assert declares(map_transforms=transforms, version=version)
    assert not declares()
    assert not declares(map_transforms=transforms, driver="loopback")
