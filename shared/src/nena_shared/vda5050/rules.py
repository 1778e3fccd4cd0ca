"""What a version of VDA 5050 requires of both sides beyond the form of its messages.

A codec reads and writes the messages of its version; the rules define what both sides do with them. Each
version defines its rules in its own package, and ``codec.rules`` has them. Data only: code that depends on
the version reads it here and never compares version numbers. If the strictest version's behaviour is allowed
in all of them, it is used for all of them and there is no field.
"""

from __future__ import annotations

from dataclasses import dataclass

from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.error import ErrorType
from nena_shared.vda5050.state import OperatingMode


@dataclass(frozen=True, slots=True)
class Rules:
    """How one version decides where the others decide differently; section numbers are those of 3.0."""

    action_statuses: frozenset[ActionStatus]
    instant_states_until_cleared: bool
    """Ended states of instant actions stay until clearInstantActions, else until an order is accepted."""
    first_update_id_is_zero: bool
    """A new order begins with orderUpdateId 0; one with another number is refused (section 6.1.1)."""
    equal_update_id_compared: bool
    """An update with the held number is refused if its content differs, else always dropped silently."""
    stitching_node_repeated: bool
    """An update repeats the decision point unchanged and in full, else only its id and number count."""
    cancel_names_order: bool
    """cancelOrder may name the order that it is for."""
    trigger_by_action: bool
    """Fleet control releases an action that waits for a trigger by an instant action (section 6.2.3)."""
    maps: bool
    """A robot reports its maps and changes them by actions (section 6.3)."""
    zones: bool
    """There are zone sets, requests and responses (sections 6.4 and 6.9)."""
    hibernation: bool
    """Fleet control may hibernate, wake and shut down a robot (section 6.2.3)."""
    wrong_stitching_node: ErrorType
    """The neutral error of an update that does not begin at the decision point; no version names it, and 2.x
    has one name for all errors of updates."""
    load_handling_device_key: str = "lhd"
    """Parameter of pick and drop for the load handling device (section 6.2.3)."""
    node_forgotten_in: frozenset[OperatingMode] = frozenset()
    """Modes that are entered with an empty lastNodeId (section 6.6.7)."""
    node_left_in: frozenset[OperatingMode] = frozenset()
    """Modes in which lastNodeId becomes empty if the node can no longer be the start of an order."""
