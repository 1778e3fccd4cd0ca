from __future__ import annotations

from nena_shared.vda5050.brief.reader import read_brief
from nena_shared.vda5050.brief.state import StateBrief
from nena_shared.vda5050.state import OperatingMode
from nena_shared.vda5050.v2_1 import CODEC
from support.fleet_examples import state


def test_parameters_have_their_neutral_names() -> None:
    reference = {"reference_key": "parameter", "reference_value": "order.edges.maximumSpeed"}
    error = {"error_type": "orderError", "error_level": "WARNING", "error_references": (reference,)}
    payload = CODEC.encode(state(errors=(error,)))
    assert b"order.edges.maxSpeed" in payload
    (entry,) = read_brief(StateBrief, CODEC, payload).errors
    assert entry.error_references[0].reference_value == "order.edges.maximumSpeed"


def test_what_2_1_spells_otherwise_is_read_as_the_codec_reads_it() -> None:
    action = {"action_id": "a", "action_type": "initializePosition", "action_status": "RUNNING"}
    said = state(operating_mode="TEACH_IN", action_states=(action,))
    payload = CODEC.encode(said).replace(b'"NONE"', b'"AUTOACK"')
    assert b'"TEACHIN"' in payload
    assert b'"initPosition"' in payload
    brief = read_brief(StateBrief, CODEC, payload)
    assert brief.operating_mode is OperatingMode.TEACH_IN
    assert brief.safety_state.field_violation
    assert brief.action_states[0].action_type == "initializePosition"


def test_a_trajectory_without_degree_and_knots_is_filled_in() -> None:
    points = ({"x": 0.0, "y": 0.0}, {"x": 1.0, "y": 0.0})
    edge = {"edge_id": "e", "sequence_id": 1, "released": True, "trajectory": {"control_points": points}}
    payload = CODEC.encode(state(edge_states=(edge,)))
    bare = payload.replace(b'"degree":1,', b"").replace(b'"knotVector":[0.0,0.0,1.0,1.0],', b"")
    assert len(bare) < len(payload)
    trajectory = read_brief(StateBrief, CODEC, bare).edge_states[0].trajectory
    assert trajectory is not None
    assert (trajectory.degree, trajectory.knot_vector) == (1, (0.0, 0.0, 1.0, 1.0))


def test_an_older_name_of_an_action_alone_is_read_as_the_newer_one() -> None:
    action = {"action_id": "a", "action_type": "initializePosition", "action_status": "RUNNING"}
    brief = read_brief(StateBrief, CODEC, CODEC.encode(state(action_states=(action,))))
    assert brief.action_states[0].action_type == "initializePosition"
