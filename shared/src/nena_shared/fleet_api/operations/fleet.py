"""Operations on the fleet as a whole: stops, summary, traffic plan, web hooks, audit trail, recordings."""

from __future__ import annotations

from nena_shared.fleet_api import requests
from nena_shared.fleet_api.audit import AuditPage, AuditQuery
from nena_shared.fleet_api.operations.operation import (
    AUDIT,
    RECORDINGS,
    STOPS,
    SUMMARY,
    TRAFFIC_PLAN,
    WEBHOOKS,
    Operation,
)
from nena_shared.fleet_api.recordings import RecordingAnswer
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.fleet_api.stops import StopEndRequest, StopList, StopRequest, StopStatus
from nena_shared.fleet_api.traffic import TrafficPlan
from nena_shared.fleet_api.webhooks import WebhookList

LIST_STOPS = Operation(
    "stops",
    "List the active stops, with who began each one and why.",
    "GET",
    STOPS,
    StopList,
    result="stops",
)

STOP = Operation(
    "stop",
    "Pause all robots, or those in an area and keep others out, until a person ends the stop.",
    "POST",
    STOPS,
    StopStatus,
    request=StopRequest,
    result="stop",
    refusals=(Refusal.TOO_MANY_STOPS, Refusal.NOT_SAVED),
)

END_STOP = Operation(
    "endStop",
    "End a stop. The robots that it has paused continue, unless another stop pauses them.",
    "POST",
    f"{STOPS}/{{name}}/end",
    StopStatus,
    request=StopEndRequest,
    may_be_empty=True,
    result="stop",
    refusals=(Refusal.UNKNOWN_STOP, Refusal.NOT_SAVED),
)

SUMMARISE = Operation(
    "summary",
    "Count unfinished orders and vehicles by state.",
    "GET",
    SUMMARY,
    requests.FleetSummary,
    result="summary",
)

SHOW_TRAFFIC_PLAN = Operation(
    "trafficPlan",
    "Return where vehicles will be in the next minute, what they hold, and what they wait for and why.",
    "GET",
    TRAFFIC_PLAN,
    TrafficPlan,
    result="traffic_plan",
)

LIST_WEBHOOKS = Operation(
    "webhooks",
    "List the web hooks with their last attempts.",
    "GET",
    WEBHOOKS,
    WebhookList,
    admin=True,
)

LIST_AUDIT = Operation(
    "auditTrail",
    "List who changed what, newest first, in rows that are chained by hashes.",
    "GET",
    AUDIT,
    AuditPage,
    admin=True,
    request=AuditQuery,
    refusals=(Refusal.NOT_SAVED,),
)

FETCH_RECORDING = Operation(
    "fetchRecording",
    "Write the decisions of the last minutes to a file, and send it to the status aggregator.",
    "POST",
    RECORDINGS,
    RecordingAnswer,
    result="recording",
    refusals=(Refusal.NO_BLACK_BOX, Refusal.RECORDING_NOT_WRITTEN),
)
