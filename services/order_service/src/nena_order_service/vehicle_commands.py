"""What hosts tell single vehicles to do, the same through both doors."""

from __future__ import annotations

from nena_order_service.host_requests import HostRequests
from nena_order_service.rest.instant_actions import answer_of, parameters_of, type_of
from nena_shared.fleet_api.requests import DispatchRequest, InstantActionAnswer, InstantActionRequest
from nena_shared.fleet_api.transport_order import TransportOrderRequest, TransportOrderStatus


async def dispatch(
    requests: HostRequests, name: str, request: DispatchRequest
) -> tuple[TransportOrderStatus, bool]:
    """Send a vehicle somewhere by a transport order that only it does; False: made before by the same key.

    Raises what :meth:`HostRequests.create` and :meth:`HostRequests.vehicle` do.
    """
    requests.vehicle(name)
    return await requests.create(
        TransportOrderRequest(
            destinations=(request.destination(),),
            intended_vehicle=name,
            priority=request.priority,
            idempotency_key=request.idempotency_key,
        )
    )


async def instant_action(
    requests: HostRequests, name: str, request: InstantActionRequest
) -> InstantActionAnswer:
    """Let a vehicle do something at once, and wait a while for the end of it.

    Raises what :meth:`HostRequests.instant_action` does.
    """
    parameters = parameters_of(request, requests, name)
    action, end = await requests.instant_action(name, type_of(request), parameters, request.blocking_type)
    return answer_of(action, end)
