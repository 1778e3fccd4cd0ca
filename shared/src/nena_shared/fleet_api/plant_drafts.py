"""Drafts of plant models, and the versions that were active, in the API."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Any, Final, Self

from pydantic import Base64Bytes, Field, model_validator

from nena_shared.fleet_api.base import DraftName, Moment, Request, Resource, VersionNumber
from nena_shared.fleet_api.reasons import OptionalReason


class PlantFinding(Resource):
    """What ``nena plant check`` says about an object of a plant model."""

    code: str
    kind: str
    """Kind of the object, such as ``point`` or ``location type``; ``model``: the plant as a whole."""
    name: str
    """Name of the object; empty: unnamed."""
    text: str
    is_error: bool
    """Whether the plant model cannot be activated; otherwise it is a warning."""
    coded_reason: OptionalReason = None
    """The text with its code and values; None: it has none."""


class PlantDraftRequest(Request):
    """Request to save a draft: a model, a file, an earlier version, or else an empty plant."""

    version: VersionNumber | None = None
    """The version that it replaces; None: a new draft."""
    # 0122: without it in the audit trail, which would keep megabytes of each save
    model: Annotated[dict[str, Any] | None, Field(exclude=True)] = None
    """The plant model in NeNa's JSON; it may have errors."""
    file: Annotated[str | None, Field(exclude=True)] = None
    """A file in any format that NeNa reads; it must have no errors."""
    from_version: Annotated[int, Field(ge=0)] | None = None
    """Number of a version of the plant; 0: the active plant."""
    map_of: DraftName | None = None
    """Another draft, whose map a new draft keeps, too."""

    @model_validator(mode="after")
    def _has_one_source(self) -> Self:
        if sum(each is not None for each in (self.model, self.file, self.from_version)) > 1:
            raise ValueError("give only one of model, file and fromVersion")
        return self


class PlantDraftStatus(Resource):
    """A draft without its model."""

    name: str
    version: int
    """Grows with each save."""
    changed: Moment
    by: str
    """Who saved it last."""
    points: int
    paths: int
    locations: int


class PlantDraftList(Resource):
    """All drafts, by name."""

    drafts: tuple[PlantDraftStatus, ...]


class PlantDraftQuery(Resource):
    """Who looks at a draft, and what is known of it."""

    session: Annotated[str, Field(max_length=64)] = ""
    """Any text that tells one open editor from others; empty: none that others should know of."""
    known: int = 0
    """The version that the client has: its model is not sent again."""
    vehicle: str = ""
    """Name of one of its vehicles."""


class PlantDraft(PlantDraftStatus):
    """A draft with its model and findings."""

    editors: tuple[str, ...] = ()
    """Users of other sessions in which it was open in the last 20 s."""
    model: dict[str, Any] | None = None
    """In NeNa's JSON, without values that are the default; None: of a version that the client has."""
    findings: tuple[PlantFinding, ...] = ()
    """Errors first; empty if ``model`` is None."""
    closed: tuple[PlantFinding, ...] = ()
    """Which paths the vehicle of the query must not use, and why."""


class SavedPlantDraft(PlantDraftStatus):
    """A draft that was saved, with what is wrong in it."""

    findings: tuple[PlantFinding, ...]


class PlantActivation(Request):
    """Request to make a draft the active plant."""

    version: VersionNumber
    """The version of the draft that the person has seen."""
    check_only: bool = False
    """Only say what stands against it."""


class PlantProgram(StrEnum):
    """What runs on a draft, in a process of its own."""

    MAP = "MAP"
    """Read a robot's map, and keep it with the draft."""
    PROPOSE = "PROPOSE"
    """``nena plant new`` on the draft's map."""
    CHECK = "CHECK"
    """``nena plant check`` with the draft's map."""
    SIMULATE = "SIMULATE"
    """``nena simulate`` of the draft and of the active plant."""


MAP_BYTES: Final = 32 * 1024 * 1024
"""Maximum size of a map's image."""

FleetSize = Annotated[int, Field(ge=1, le=200)]


class PlantMapFiles(Request):
    """A map as map_saver writes it."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_ .-]{0,79}$")]
    """Name of the map: that of its YAML file."""
    yaml: Annotated[str, Field(max_length=100_000)]
    image: Annotated[Base64Bytes, Field(max_length=MAP_BYTES)]
    """The PGM, PNG or BMP file in Base64."""


class PlantRunRequest(Request):
    """Request to run a program on a draft."""

    program: PlantProgram
    map: Annotated[PlantMapFiles | None, Field(exclude=True)] = None
    """MAP: the files."""
    robot_width: Annotated[float, Field(ge=0.05, le=10)] = 0.6
    """PROPOSE and CHECK, as all lengths: m."""
    robot_length: Annotated[float, Field(ge=0.05, le=10)] = 0.8
    clearance: Annotated[float, Field(ge=0, le=5)] = 0.1
    """Room that stays free on each side of a robot."""
    spacing: Annotated[float, Field(ge=0.5, le=20)] = 3.0
    """PROPOSE: distance between points."""
    robots: Annotated[tuple[FleetSize, ...], Field(min_length=1, max_length=6)] = (3, 6)
    """SIMULATE: fleet sizes."""
    hours: Annotated[float, Field(ge=0.05, le=8)] = 0.5
    """SIMULATE: simulated hours."""
    orders: Annotated[str, Field(max_length=1_000_000)] = ""
    """SIMULATE: CSV with from,to,per_hour or at,from,to; empty: between all stations."""

    @model_validator(mode="after")
    def _has_a_map(self) -> Self:
        if (self.program is PlantProgram.MAP) is not (self.map is not None):
            raise ValueError("give map for the program MAP, and for no other")
        return self


class PlantFigures(Resource):
    """What ``nena simulate`` says about one fleet size."""

    robots: int
    orders_per_hour: float
    finished: int
    failed: int
    lead_p50: float | None
    """Median time from an order's creation to its end, s."""
    doing: dict[str, float]
    """Share of the robots' time by activity."""
    waiting_by_place: dict[str, float]
    """Robot minutes per hour by path or point."""
    notes: tuple[str, ...]


class PlantRunState(StrEnum):
    """How far a program is."""

    NONE = "NONE"
    """None has run."""
    RUNNING = "RUNNING"
    DONE = "DONE"
    FAILED = "FAILED"
    CANCELLED = "CANCELLED"


class PlantRunQuery(Resource):
    """Which run to show."""

    program: PlantProgram | None = None
    """PROPOSE, CHECK or SIMULATE: the last one on this draft that was done; None: the last on any draft."""


class PlantRun(Resource):
    """A program that runs on a draft, or ran on one."""

    state: PlantRunState = PlantRunState.NONE
    draft: str = ""
    version: int = 0
    """The version of the draft when it began."""
    program: PlantProgram | None = None
    began: Moment | None = None
    by: str = ""
    texts: tuple[str, ...] = ()
    """Why it failed, or what a person should know."""
    model: dict[str, Any] | None = None
    """PROPOSE: the plant model in NeNa's JSON."""
    findings: tuple[PlantFinding, ...] = ()
    """CHECK."""
    figures: tuple[PlantFigures, ...] = ()
    """SIMULATE: of the draft, for each fleet size."""
    active_figures: tuple[PlantFigures, ...] = ()
    """SIMULATE: of the active plant; empty if it cannot be simulated with these orders."""


class PlantMapPicture(Resource):
    """A map as it is drawn under a plan."""

    name: str
    width: int
    """In cells, as is the height."""
    height: int
    resolution: float
    """Side of a cell, m."""
    x: float
    """Pose of the lower left corner, m and rad."""
    y: float
    theta: float
    picture: str
    """PNG in Base64: the darker the map, the more opaque."""


class PlantDraftMap(Resource):
    """The robot's map that is kept with a draft."""

    map: PlantMapPicture | None = None
    """None: the draft has no map."""


class PlantFileFormat(StrEnum):
    """Formats of files."""

    NENA = "nena"
    OPENTCS = "opentcs"
    LIF = "lif"
    LIF_2_0 = "lif2"
    NAV2_ROUTE = "nav2-route"


class PlantFileQuery(Resource):
    """Which file of a draft to write."""

    format: PlantFileFormat = PlantFileFormat.NENA
    map_id: str | None = None
    """LIF: the map of points without one; route graph: the map, if there are several."""


class PlantFileContent(Resource):
    """A draft as a file."""

    file_name: str
    content: str
    losses: tuple[str, ...]
    """What the format cannot represent."""


class DifferenceKind(StrEnum):
    """What happened to an object from one plant model to another."""

    ADDED = "ADDED"
    REMOVED = "REMOVED"
    MOVED = "MOVED"
    CHANGED = "CHANGED"


class PlantDifference(Resource):
    """An object in which two plant models differ."""

    change: DifferenceKind
    kind: str
    name: str
    distance: float | None = None
    """How far it was moved, m."""
    fields: tuple[str, ...] = ()
    """Names of other changed fields."""


class PlantDifferencesQuery(Resource):
    """With which version of the plant to compare."""

    with_version: Annotated[int, Field(ge=0)] = 0
    """0: the active plant; for a version: the one before it."""


class PlantDifferences(Resource):
    """What differs between two plant models: points, paths, locations and their types, blocks, vehicles."""

    differences: tuple[PlantDifference, ...]
    more: int = 0
    """Number of further differences."""


class PlantVersion(Resource):
    """A plant model that was active."""

    number: int
    activated: Moment
    by: str
    """Who activated it; empty: it was the plant model file at a start of the order service."""
    draft: str = ""
    """The draft that it was made from; empty: none."""
    name: str
    """Name of the plant."""
    points: int
    paths: int
    locations: int


class PlantVersionList(Resource):
    """The last versions, newest first: the first is the active plant."""

    versions: tuple[PlantVersion, ...]
