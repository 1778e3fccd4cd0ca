"""Who waits for whom, to the head."""

from __future__ import annotations

from collections.abc import Mapping

from hypothesis import given
from hypothesis import strategies as st

from nena_shared.fleet_api.wait_chains import WaitChain, chain_from, wait_chains


def test_chain_leads_to_the_vehicle_that_is_not_waiting() -> None:
    chains = wait_chains({"A": ["B"], "B": ["C"]})
    assert chains == {"A": WaitChain("B", "C"), "B": WaitChain("C", "C")}
    assert chain_from("A", chains) == ("A", "B", "C")
    assert chain_from("C", chains) == ("C",)


def test_vehicles_that_wait_in_a_circle_have_no_head() -> None:
    chains = wait_chains({"B": ["C"], "C": ["A"], "A": ["B"], "D": ["C"]})
    circle = ("A", "B", "C")
    assert chains["D"] == WaitChain("C", None, circle)
    assert {chain.end for chain in chains.values()} == {circle}
    assert chain_from("D", chains) == ("D", "C", "A", "B")


def test_two_circles_are_distinguished() -> None:
    chains = wait_chains({"A": ["B"], "B": ["A"], "C": ["D"], "D": ["C"], "E": ["D"]})
    assert chains["B"].end == ("A", "B")
    assert chains["E"].end == ("C", "D")


def test_unknown_vehicle_is_a_head() -> None:
    assert wait_chains({"A": ["nobody heard of it"]})["A"].head == "nobody heard of it"


def test_stuck_vehicle_is_the_head_of_its_queue_even_if_it_waits() -> None:
    chains = wait_chains({"A": ["B"], "B": ["C"], "C": ["A"]}, {"B"})
    assert chains == {"A": WaitChain("B", "B"), "C": WaitChain("A", "B")}


def test_of_several_the_one_that_needs_a_person_is_followed() -> None:
    waits = {"A": ["drives", "B", "stuck behind"], "B": ["A"], "stuck behind": ["stuck"]}
    assert wait_chains(waits, {"stuck"})["A"] == WaitChain("stuck behind", "stuck")
    assert wait_chains(waits, ())["A"] == WaitChain("B", None, ("A", "B"))
    del waits["B"]
    assert wait_chains(waits, ())["A"] == WaitChain("drives", "drives")


def test_vehicle_does_not_wait_for_itself() -> None:
    assert wait_chains({"A": ["A"], "B": ["A"], "C": []}) == {"B": WaitChain("A", "A")}


def test_long_queue_is_followed_in_one_step() -> None:
    waits = {str(number): [str(number + 1)] for number in range(5000)}
    chains = wait_chains(waits)
    assert {chain.head for chain in chains.values()} == {"5000"}
    assert len(chain_from("0", chains)) == 5001


def test_a_vehicle_behind_a_circle_that_also_waits_for_another_circle_is_behind_its_own() -> None:
    chains = wait_chains({"D": ["G"], "G": ["D"], "A": ["B", "D"], "B": ["A"], "E": ["A"]})
    assert chains["A"].circle == ("A", "B")
    assert chains["E"] == WaitChain("A", None, ("A", "B"))


NAMES = st.sampled_from("ABCDEFG")


@given(st.dictionaries(NAMES, st.lists(NAMES, max_size=3)), st.sets(NAMES, max_size=2))
def test_chains_are_consistent_for_any_waits(waits: Mapping[str, list[str]], stuck: set[str]) -> None:
    chains = wait_chains(waits, stuck)
    waiting = {name for name, others in waits.items() if set(others) - {name} and name not in stuck}
    assert chains.keys() == waiting
    for name, chain in chains.items():
        assert chain.next in waits[name]
        last = chain_from(name, chains)[-1]
        if chain.head is None:
            assert name in chain.circle or chains[chain.next].circle == chain.circle
            assert last in chain.circle
            for one, other in zip(chain.circle, (*chain.circle[1:], chain.circle[0]), strict=True):
                assert other in waits[one]
        else:
            assert chain.head == last
            assert chain.head not in chains
    reachable = {name for name in chains if _reaches(name, waits, stuck)}
    assert {name for name, chain in chains.items() if chain.head in stuck} == reachable


def _reaches(name: str, waits: Mapping[str, list[str]], stuck: set[str]) -> bool:
    """Return whether the waiting of a vehicle leads to a stuck one."""
    seen, left = set[str](), [name]
    while left:
        each = left.pop()
        if each in stuck:
            return True
        if each not in seen:
            seen.add(each)
            left += waits.get(each, [])
    return False
