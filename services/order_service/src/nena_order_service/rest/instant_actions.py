"""Between instant actions as hosts name them and those of VDA 5050."""

from __future__ import annotations

from nena_order_service.fleet import InstantActionEnded
from nena_order_service.host_requests import HostRequests
from nena_shared.fleet_api.requests import InitialPose, InstantActionAnswer, InstantActionRequest
from nena_shared.plant import PlantPose
from nena_shared.vda5050.action import Action, ActionParameter

TYPES = {"pause": "startPause", "resume": "stopPause"}


def type_of(request: InstantActionRequest) -> str:
    """Give VDA 5050's name of the action."""
    return TYPES.get(request.action_type, request.action_type)


def parameters_of(
    request: InstantActionRequest, requests: HostRequests, vehicle: str
) -> tuple[ActionParameter, ...]:
    """Give the parameters; a pose is put into the frame of the vehicle's map."""
    given = tuple(ActionParameter(key=each.key, value=each.value) for each in request.parameters)
    return (*_pose(request.pose, requests, vehicle), *given) if request.pose else given


def _pose(pose: InitialPose, requests: HostRequests, vehicle: str) -> tuple[ActionParameter, ...]:
    robot = requests.robot_pose(vehicle, PlantPose(pose.x, pose.y, pose.theta), pose.map_id)
    return (
        ActionParameter(key="x", value=robot.pose.x_m),
        ActionParameter(key="y", value=robot.pose.y_m),
        ActionParameter(key="theta", value=robot.pose.heading_rad),
        ActionParameter(key="mapId", value=robot.map_id),
        ActionParameter(key="lastNodeId", value=robot.point),
    )


def answer_of(action: Action, end: InstantActionEnded | None) -> InstantActionAnswer:
    """Tell what became of an action; ``end`` None: it goes on."""
    if end is None:
        return InstantActionAnswer(
            action_id=action.action_id,
            action_type=action.action_type,
            status="PENDING",
            reason="the robot has not told its end yet",
        )
    return InstantActionAnswer(
        action_id=action.action_id,
        action_type=action.action_type,
        status=end.status or "UNKNOWN",
        reason=end.reason,
        result=end.result,
    )
