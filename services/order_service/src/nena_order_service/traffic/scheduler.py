"""Scheduler: which vehicle holds, claims or will rest on which resource, and who goes first.

See decision 0038. The terms *claim* and *allocate* are those of openTCS.
"""

from __future__ import annotations

from collections import Counter, defaultdict, deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from enum import Enum, auto
from itertools import chain

from nena_order_service.traffic.resources import Occupant, ResourceSet, UseIndex, Uses
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.plant.track import MM_PER_M

R = ReasonCode


class WaitReason(Enum):
    """Why resources are not granted."""

    HELD = auto()
    """Others hold them, and will continue."""
    RESTING = auto()
    """Others rest on them."""
    ORDER = auto()
    """Others must go first, or the vehicles would block each other."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a vehicle must wait, and which vehicles it waits for."""

    reason: WaitReason
    vehicles: tuple[str, ...]
    resource: str
    between: tuple[str, ...] = ()
    """The vehicles that close the cycle: through them, ``vehicles`` and the waiting one would deadlock."""
    way: tuple[ResourceSet, ...] = field(default=(), compare=False, repr=False)
    """The requested resources, if others must go first to avoid a deadlock."""
    turn_back_mm: int = field(default=0, compare=False)
    """How far the first vehicle would have to turn back if the refused one went first."""

    def __str__(self) -> str:
        return str(self.in_words())

    @property
    def cause(self) -> tuple[WaitReason, tuple[str, ...], str]:
        """Why, for whom and where the vehicle waits."""
        return self.reason, self.vehicles, self.resource

    def in_words(self) -> Reason:
        """Return, as a predicate, which vehicles are waited for, where and why."""
        names, is_one = ", ".join(self.vehicles), len(self.vehicles) == 1
        match self.reason:
            case WaitReason.HELD:
                code = R.YIELDS_TO if is_one else R.YIELDS_TO_SEVERAL
            case WaitReason.RESTING:
                code = R.STANDS_ON if is_one else R.STAND_ON
            case WaitReason.ORDER:
                if self.turn_back_mm:
                    metres = max(1, round(self.turn_back_mm / MM_PER_M))
                    why = Reason(R.WOULD_TURN_BACK, metres=metres)
                else:
                    why = Reason(R.WOULD_BLOCK if self.between else R.WAITED_LONGER)
                code = R.GOES_FIRST if is_one else R.GO_FIRST
                return Reason(code, why, vehicles=names, at=self.resource)
        return Reason(code, vehicles=names, at=self.resource)


class UnknownOccupantError(LookupError):
    """The position of the vehicle ``name`` is unknown to traffic control."""

    def __init__(self, name: str) -> None:
        self.name = name
        super().__init__(f"the position of vehicle {name!r} is unknown")


class Scheduler:
    """Tracks which vehicle holds, claims and will rest on which resources, by their names in the plant."""

    def __init__(self) -> None:
        self._occupants: dict[str, Occupant] = {}
        self._holds = UseIndex()
        self._claims = UseIndex()
        self._ends = UseIndex()
        # What vehicles will rest on is indexed as well: who ends there must arrive after all who pass it.
        self._rests: dict[str, list[ResourceSet]] = {}
        self.changed: set[str] = set()
        """The vehicles that have moved or changed what they use; cleared by its reader."""
        self._later: defaultdict[str, Counter[str]] = defaultdict(Counter)
        """For each vehicle, those that cannot arrive before it, with the number of resources concerned."""

    def occupant(self, name: str) -> Occupant:
        """Return a vehicle's occupancy, read-only; raises UnknownOccupantError."""
        try:
            return self._occupants[name]
        except KeyError:
            raise UnknownOccupantError(name) from None

    def __contains__(self, name: str) -> bool:
        return name in self._occupants

    @property
    def vehicle_names(self) -> tuple[str, ...]:
        """Return the names of the known vehicles."""
        return tuple(self._occupants)

    def place_at_rest(
        self, name: str, place: Iterable[ResourceSet], length_mm: int, *, entry: ResourceSet | None = None
    ) -> None:
        """Place a vehicle at rest on ``place``, oldest set first, whether or not others are there.

        ``entry`` is what it needs to reach the point of the last set, unless it is already there.
        """
        self.remove(name)
        sets = deque(place)
        self._occupants[name] = Occupant(name, length_mm, sets, reached=len(sets) - 1, entry=entry)
        for resource_set in sets:
            self._add_use(self._holds, name, resource_set.uses)

    def remove(self, name: str) -> None:
        """Remove a vehicle and free what it holds; does nothing for an unknown one."""
        if name not in self._occupants:
            return
        self.give_up_claim(name)
        self._forget_end(name)
        for resource_set in self._occupants.pop(name).held:
            self._remove_use(self._holds, name, resource_set.uses)

    def claim(self, name: str, way: Sequence[ResourceSet]) -> Refusal | None:
        """Claim a route that follows what the vehicle holds.

        Return the refusal, in which case nothing has changed; None on success. Replaces an existing claim.
        """
        occupant = self.occupant(name)
        # It may not claim what another one rests on: nothing says that this one will leave (decision 0021).
        if refusal := self._why_resting(name, way):
            return refusal
        # Tried and taken back: the precedence that follows from a claim is only known once it is entered.
        last_claim, changed = tuple(occupant.claimed), name in self.changed
        self._set_claim(occupant, way)
        if refusal := self._find_cycle(name):
            self._set_claim(occupant, last_claim)
            if not changed:
                self.changed.discard(name)
        return refusal

    def allocate(self, name: str) -> Refusal | None:
        """Allocate the next claimed set; return the refusal, in which case nothing has changed.

        Raises:
            LookupError: the vehicle is not known, or claims nothing.
        """
        occupant = self.occupant(name)
        if not occupant.claimed:
            message = f"vehicle {name!r} claims nothing"
            raise LookupError(message)
        wanted = occupant.claimed[0]
        # Another vehicle may have stopped on the route since the claim, and must be able to leave.
        if refusal := self._why_resting(name, occupant.claimed):
            return refusal
        if holders := list(self._holds.other_users(name, wanted.uses)):
            resting = all(self._occupants[holder].resting for holder, _ in holders)
            names = tuple(dict.fromkeys(holder for holder, _ in holders))
            return Refusal(WaitReason.RESTING if resting else WaitReason.HELD, names, holders[0][1])
        # A free resource goes to the vehicle that must pass it first: otherwise the two would deadlock.
        for claimer, resource in self._claims.other_users(name, wanted.uses):
            if between := self._find_chain(claimer, name):
                return Refusal(WaitReason.ORDER, (claimer,), resource, between, tuple(occupant.claimed))
        self.seize(name)
        return None

    def restore_claim(self, name: str, held: Sequence[ResourceSet], claimed: Sequence[ResourceSet]) -> None:
        """Restore what a vehicle at rest held and claimed before, without checks."""
        occupant = self.occupant(name)
        for resource_set in held:
            self._add_use(self._holds, name, resource_set.uses)
        occupant.held.extend(held)
        self._set_claim(occupant, claimed)

    def seize(self, name: str) -> None:
        """Allocate the vehicle's next claimed set without checks: it is already there."""
        occupant = self.occupant(name)
        taken = occupant.claimed.popleft()
        self._remove_use(self._claims, name, taken.uses)
        occupant.held.append(taken)
        self._add_use(self._holds, name, taken.uses)

    def give_back(self, name: str, count: int) -> None:
        """Return the last ``count`` held sets, where the vehicle was not let, to the start of its claim."""
        occupant = self.occupant(name)
        for _ in range(count):
            returned = occupant.held.pop()
            self._remove_use(self._holds, name, returned.uses)
            occupant.claimed.appendleft(returned)
            self._add_use(self._claims, name, returned.uses)

    def holders_of(self, resource: str) -> frozenset[str]:
        """Return the vehicles that hold ``resource``."""
        return self._holds.users_of(resource)

    def arrive(self, name: str, index: int) -> bool:
        """Note that the vehicle has arrived at its ``index``-th held set; return whether that frees any."""
        occupant = self.occupant(name)
        freed = occupant.arrive(index)
        for resource_set in freed:
            self._remove_use(self._holds, name, resource_set.uses)
        self.changed.add(name)
        if occupant.resting:  # others may now have to send it away
            self._forget_end(name)
        return bool(freed)

    def give_up_claim(self, name: str) -> None:
        """Drop a vehicle's claim; it keeps what it holds, because it may still drive there."""
        self._set_claim(self.occupant(name), ())

    def find_sharer(self, name: str) -> tuple[str, str] | None:
        """Return another vehicle on one of this one's exclusive resources, and the resource; or None."""
        return next(self._other_users(self._holds, name, self.occupant(name).held), None)

    def turn_back_mm(self, refusal: Refusal) -> int:
        """Return how far, mm, the first vehicle would have to turn back if the refused one went first.

        That is from its current point to the end of the refused route, if it is oncoming.
        """
        if not refusal.way or refusal.vehicles[0] not in self._occupants:
            return 0
        first, way = self._occupants[refusal.vehicles[0]], refusal.way
        index = next(
            (index for index, resource_set in enumerate(way) if resource_set.point == first.point), None
        )
        following = next(iter((*tuple(first.held)[first.reached + 1 :], *first.claimed)), None)
        if index is None or following is None:
            return 0
        passed = {use for resource_set in way[: index + 1] for use in resource_set.uses} - {first.point}
        return (
            0
            if passed.isdisjoint(following.uses)
            else sum(resource_set.length_mm for resource_set in way[index + 1 :])
        )

    def users_of(self, resource: str) -> frozenset[str]:
        """Return the vehicles that hold, claim or will rest on ``resource``."""
        return (
            self._holds.users_of(resource) | self._claims.users_of(resource) | self._ends.users_of(resource)
        )

    def resting_on(self, name: str, way: Iterable[ResourceSet]) -> tuple[str, ...]:
        """Return the vehicles that rest where ``name`` would have to pass or to stop."""
        holders = (holder for holder, _ in self._other_users(self._holds, name, way))
        return tuple(dict.fromkeys(holder for holder in holders if self._occupants[holder].resting))

    def rests_or_will_rest_on(self, name: str, way: Iterable[ResourceSet]) -> bool:
        """Return whether others rest, or will rest, where ``name`` would have to pass or to stop."""
        way = tuple(way)
        return bool(self.resting_on(name, way)) or any(self._other_users(self._ends, name, way))

    def end_of(self, name: str, way: Sequence[ResourceSet]) -> list[ResourceSet]:
        """Return what the vehicle would rest on at the end of ``way``."""
        return self.occupant(name).at_end(way)

    def free_of_rest(self, name: str, way: Iterable[ResourceSet]) -> int:
        """Return how many sets of a route precede the first one on which another vehicle rests."""
        count = 0
        for resource_set in way:
            if any(
                self._occupants[holder].resting
                for holder, _ in self._holds.other_users(name, resource_set.uses)
            ):
                break
            count += 1
        return count

    def _set_claim(self, occupant: Occupant, way: Sequence[ResourceSet]) -> None:
        name = occupant.name
        for resource_set in occupant.claimed:
            self._remove_use(self._claims, name, resource_set.uses)
        self._forget_end(name)
        occupant.claimed = deque(way)
        for resource_set in way:
            self._add_use(self._claims, name, resource_set.uses)
        if not occupant.resting:
            self._rests[name] = occupant.at_end(way)
            for resource_set in self._rests[name]:
                self._add_use(self._ends, name, resource_set.uses)

    def _forget_end(self, name: str) -> None:
        for resource_set in self._rests.pop(name, ()):
            self._remove_use(self._ends, name, resource_set.uses)

    def _other_users(
        self, index: UseIndex, name: str, sets: Iterable[ResourceSet]
    ) -> Iterator[tuple[str, str]]:
        return index.other_users(name, *[resource_set.uses for resource_set in sets])

    def _why_resting(self, name: str, way: Iterable[ResourceSet]) -> Refusal | None:
        way = tuple(way)
        for holder, resource in self._other_users(self._holds, name, way):
            if self._occupants[holder].resting:
                return Refusal(WaitReason.RESTING, self.resting_on(name, way), resource)
        return None

    def _find_cycle(self, name: str) -> Refusal | None:
        """Return the refusal by a vehicle that must go both before and after this one, if any."""
        ring = self._find_chain(name, name)
        if not ring:
            return None
        first, occupant = ring[1] if len(ring) > 1 else name, self._occupants[name]
        behind = chain(
            self._other_users(self._claims, name, occupant.held),
            self._other_users(self._ends, name, occupant.claimed),
        )
        resource = next((resource for vehicle, resource in behind if vehicle == first), "")
        return Refusal(WaitReason.ORDER, (first,), resource, ring, tuple(occupant.claimed))

    def _find_chain(self, first: str, later: str) -> tuple[str, ...]:
        """Return the vehicles through which ``first`` must arrive before ``later``, starting with ``first``.

        Empty if it need not.
        """
        came_from = {first: ""}
        open_ends = [first]
        while open_ends:
            name = open_ends.pop()
            followers = self._later.get(name, ())
            if later in followers:
                links = [name]
                while came_from[links[-1]]:
                    links.append(came_from[links[-1]])
                return tuple(reversed(links))
            for follower in followers:
                if follower not in came_from:
                    came_from[follower] = name
                    open_ends.append(follower)
        return ()

    def _add_use(self, index: UseIndex, name: str, uses: Uses) -> None:
        """Add a use, and the precedence that follows from it."""
        self.changed.add(name)
        self._update_precedence(index, name, index.add(name, uses), 1)

    def _remove_use(self, index: UseIndex, name: str, uses: Uses) -> None:
        """Remove a use, and the precedence that followed from it."""
        self.changed.add(name)
        self._update_precedence(index, name, index.remove(name, uses), -1)

    def _update_precedence(self, index: UseIndex, name: str, uses: Uses, count: int) -> None:
        # Others pass after the vehicle that holds a resource, and before one that will rest there.
        if index is self._claims:
            for holder, _ in self._holds.other_users(name, uses):
                self._put_behind(holder, name, count)
            for rester, _ in self._ends.other_users(name, uses):
                self._put_behind(name, rester, count)
        else:
            for claimer, _ in self._claims.other_users(name, uses):
                first, later = (name, claimer) if index is self._holds else (claimer, name)
                self._put_behind(first, later, count)

    def _put_behind(self, first: str, later: str, count: int) -> None:
        followers = self._later[first]
        followers[later] += count
        if not followers[later]:
            del followers[later]
