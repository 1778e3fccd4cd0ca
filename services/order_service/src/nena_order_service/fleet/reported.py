"""What robots report, as fleet control reads it: in brief; the fields of the full messages are the same."""

from __future__ import annotations

from nena_shared.vda5050 import action, error, request, state
from nena_shared.vda5050.brief import state as brief

State = state.State | brief.StateBrief
ErrorEntry = error.ErrorEntry | brief.ErrorBrief
ActionState = action.ActionState | brief.ActionBrief
Position = state.MobileRobotPosition | brief.PositionBrief
ZoneRequest = request.ZoneRequest | brief.ZoneRequestBrief
EdgeRequest = request.EdgeRequest | brief.EdgeRequestBrief
