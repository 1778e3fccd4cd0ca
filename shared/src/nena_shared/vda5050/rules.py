"""Rules of a VDA 5050 version for both sides, beyond the format of its messages.

Each version defines its rules in its own package, as ``codec.rules``. Code that depends on the version reads
them instead of comparing version numbers. Where the strictest version's behaviour is allowed in all versions,
it is used for all of them and needs no field.
"""

from __future__ import annotations

from dataclasses import dataclass

from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.error import ErrorType
from nena_shared.vda5050.state import OperatingMode


@dataclass(frozen=True, slots=True)
class Rules:
    """Rules in which the versions differ; section numbers are those of 3.0."""

    action_statuses: frozenset[ActionStatus]
    instant_states_until_cleared: bool
    """States of ended instant actions are kept until clearInstantActions; else until an order is accepted."""
    first_update_id_is_zero: bool
    """New orders must have orderUpdateId 0; others are rejected (section 6.1.1)."""
    equal_update_id_compared: bool
    """An update with the current orderUpdateId but other content is rejected; else it is ignored."""
    stitching_node_repeated: bool
    """An update must repeat the decision point unchanged; else only its nodeId and sequenceId count."""
    cancel_names_order: bool
    """cancelOrder may contain the ID of the order to cancel."""
    trigger_by_action: bool
    """Fleet control triggers a waiting action with an instant action (section 6.2.3)."""
    maps: bool
    """Robots report their maps, and actions change them (section 6.3)."""
    zones: bool
    """The version has zone sets, requests and responses (sections 6.4 and 6.9)."""
    hibernation: bool
    """Fleet control can hibernate, wake up and shut down robots (section 6.2.3)."""
    wrong_stitching_node: ErrorType
    """Neutral error type for an update that does not start at the decision point. No version names this
    error; 2.x has one type for all update errors."""
    load_handling_device_key: str = "lhd"
    """Parameter of pick and drop for the load handling device (section 6.2.3)."""
    node_forgotten_in: frozenset[OperatingMode] = frozenset()
    """Modes that clear lastNodeId on entry (section 6.6.7)."""
    node_left_in: frozenset[OperatingMode] = frozenset()
    """Modes that clear lastNodeId once no order can start at that node any more."""
