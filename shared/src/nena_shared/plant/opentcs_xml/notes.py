"""What is found while a file is read: errors, warnings, and what the reader passed over."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

from nena_shared.plant.errors import ObjectKind, Problem
from nena_shared.plant.opentcs_xml.format_version import FormatVersion


@dataclass(slots=True)
class Notes:
    """Findings in the order in which they were met; `version` decides what counts as one."""

    version: FormatVersion
    errors: list[Problem] = field(default_factory=list)
    warnings: list[Problem] = field(default_factory=list)
    is_old: bool = field(init=False)
    """Whether the file is of a format before 6.0.0, in which many attributes may be missing."""
    _ignored: Counter[tuple[ObjectKind, str]] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self.is_old = self.version.is_old

    def error(self, code: str, kind: ObjectKind, name: str, text: str) -> None:
        """Add an error: the model will be refused when all of it has been read."""
        self.errors.append(Problem(code, kind, name, text))

    def warn(self, code: str, kind: ObjectKind, name: str, text: str) -> None:
        """Add a warning: the model can be used."""
        self.warnings.append(Problem(code, kind, name, text))

    def ignore(self, kind: ObjectKind, what: str, times: int = 1) -> None:
        """Count something that is not read; thousands of paths with one old attribute give one warning."""
        self._ignored[kind, what] += times

    def ignored(self) -> Iterator[Problem]:
        """Yield one warning for each kind of thing that was passed over."""
        for (kind, what), times in sorted(self._ignored.items()):
            yield Problem("IGNORED", kind, "", f"{what} is not used (found {times} times)")
