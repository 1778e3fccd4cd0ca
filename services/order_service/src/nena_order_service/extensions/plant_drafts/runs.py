"""Programs on drafts: read a map, propose, check, simulate. Each in a process of its own, with limits."""

from __future__ import annotations

import asyncio
import json
import os
import resource
import signal
import sys
from base64 import b64decode, b64encode
from collections import Counter
from collections.abc import Collection
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from nena_order_service.errors import RefusedError
from nena_order_service.extension import Core
from nena_order_service.extensions.plant_drafts.drafts import Drafts
from nena_shared.fleet_api.plant_drafts import (
    PlantDraftMap,
    PlantFigures,
    PlantFinding,
    PlantMapPicture,
    PlantProgram,
    PlantRun,
    PlantRunQuery,
    PlantRunRequest,
    PlantRunState,
)
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.plant import BACKWARD_SUFFIX
from nena_shared.tasks import report_failure

SECONDS: Final = {
    PlantProgram.MAP: 60.0,
    PlantProgram.PROPOSE: 120.0,
    PlantProgram.CHECK: 60.0,
    PlantProgram.SIMULATE: 600.0,
}
"""Maximum time of each program."""
MEMORY: Final = 4 * 1024**3
"""Address space of each process, bytes: libraries reserve more of it than they use."""
NICENESS: Final = 10
"""The fleet goes first."""
TEXT_SHOWN: Final = 2000
NO_MAP: Final = (
    "The draft has no map. Upload the YAML file and the image that map_saver wrote, or take a robot's."
)
NEEDED: Final = dict.fromkeys(PlantProgram, ("nena_cli", "skimage")) | {
    PlantProgram.SIMULATE: ("nena_simulate",)
}


class RunFailedError(Exception):
    """A program has no result; the text says why."""


class Runs:
    """Runs one program at a time."""

    def __init__(self, core: Core, drafts: Drafts) -> None:
        self._core = core
        self._drafts = drafts
        self._last = PlantRun()
        self._task: asyncio.Task[None] | None = None

    async def map(self, name: str) -> PlantDraftMap:
        """Return the map of a draft; raises UnknownError."""
        self._drafts.status(name)
        kept = await self._map(name)
        return PlantDraftMap(map=PlantMapPicture(**kept["picture"]) if kept else None)

    async def show(self, name: str, request: PlantRunQuery) -> PlantRun:
        """Return the last run, or the last result of a program; raises UnknownError."""
        self._drafts.status(name)
        if request.program is None:
            return self._last
        kept = request.program is not PlantProgram.MAP and await self._drafts.result(name, request.program)
        return PlantRun.model_validate_json(kept) if kept else PlantRun()

    async def start(self, name: str, request: PlantRunRequest, caller: str) -> PlantRun:
        """Start a program; raises UnknownError, and RefusedError while another one runs."""
        version = self._drafts.status(name).version
        if self._task and not self._task.done():
            raise RefusedError(
                Refusal.PLANT_RUN_GOES_ON,
                f"{self._last.program} runs on the draft {self._last.draft!r}, started by {self._last.by}. "
                "Wait, or cancel it.",
            )
        of: dict[str, Any] = {"draft": name, "version": version, "program": request.program, "by": caller}
        self._last = PlantRun(state=PlantRunState.RUNNING, began=self._core.clock.now(), **of)
        self._task = asyncio.create_task(self._run(name, request), name="program on a draft")
        return self._last

    async def cancel(self, name: str) -> PlantRun:
        """End the program that runs; raises UnknownError."""
        self._drafts.status(name)
        await self.end()
        return self._last

    async def end(self) -> None:
        """End the program that runs, if any, with all its processes."""
        if self._task:
            self._task.cancel()
            await asyncio.wait((self._task,))
            if self._last.state is PlantRunState.RUNNING:
                self._last = self._last.model_copy(update={"state": PlantRunState.CANCELLED})

    async def _run(self, name: str, request: PlantRunRequest) -> None:
        try:
            with TemporaryDirectory(prefix="nena-plant-") as folder:
                found = await asyncio.wait_for(
                    self._results(Path(folder), name, request), SECONDS[request.program]
                )
            ended: dict[str, Any] = {"state": PlantRunState.DONE, **found}
            if request.program is not PlantProgram.MAP:
                done = self._last.model_copy(update=ended)
                await self._drafts.keep(name, request.program, done.model_dump_json(by_alias=True))
        except TimeoutError:
            text = f"It was ended after {SECONDS[request.program]:.0f} s. Try less at once."
            ended = {"state": PlantRunState.FAILED, "texts": (text,)}
        except Exception as error:  # noqa: BLE001 - the person is told
            ended = {"state": PlantRunState.FAILED, "texts": (str(error),)}
            if not isinstance(error, RunFailedError):
                report_failure("a program on a draft failed", error, program=request.program)
        self._last = self._last.model_copy(update=ended)

    async def _results(self, folder: Path, name: str, request: PlantRunRequest) -> dict[str, Any]:
        missing = [module for module in NEEDED[request.program] if find_spec(module) is None]
        if missing:
            raise RunFailedError(
                f"{', '.join(missing)} is not installed beside the order service (its container image does "
                "not have it). Install it with pip install 'nena-order-service[plant-editor]', or run `nena "
                "plant new` and `nena simulate` on another computer and begin a draft with the plant that "
                "they write."
            )
        programs = {
            PlantProgram.MAP: self._keep_map,
            PlantProgram.PROPOSE: self._propose,
            PlantProgram.CHECK: self._check,
            PlantProgram.SIMULATE: self._simulate,
        }
        return await programs[request.program](folder, name, request)

    async def _keep_map(self, folder: Path, name: str, request: PlantRunRequest) -> dict[str, Any]:
        files = request.map
        if files is None:
            raise RunFailedError(NO_MAP)
        file = folder / "map.yaml"
        file.write_text(files.yaml, encoding="utf-8")
        (folder / "image").write_bytes(files.image)
        about = await _execute(folder, "nena_plant_formats.from_map", file.name)
        picture = {"name": files.name, **json.loads(about)}
        kept = {"picture": picture, "yaml": file.read_text(encoding="utf-8")}
        kept["image"] = b64encode(files.image).decode()
        await self._drafts.keep(name, PlantProgram.MAP, json.dumps(kept))
        return {}

    async def _propose(self, folder: Path, name: str, request: PlantRunRequest) -> dict[str, Any]:
        robot = ("--robot-width", request.robot_width, "--robot-length", request.robot_length)
        room = ("--clearance", request.clearance, "--spacing", request.spacing)
        file = await self._write_map(folder, name)
        done = await _execute(
            folder, "nena_cli", "plant", "new", "--map", file, "-o", "new.json", *robot, *room
        )
        model = json.loads((folder / "new.json").read_text(encoding="utf-8"))
        return {"model": model, "texts": tuple(done.splitlines())}

    async def _check(self, folder: Path, name: str, request: PlantRunRequest) -> dict[str, Any]:
        robot = ("--robot-width", request.robot_width, "--clearance", request.clearance)
        file = await self._write_map(folder, name)
        (folder / "draft.json").write_text(await self._drafts.text(name), encoding="utf-8")
        # Status 1: the draft has errors.
        done = await _execute(
            folder, "nena_cli", "plant", "check", "draft.json", "--json", "--map", file, *robot, good=(0, 1)
        )
        if not done.startswith("{"):  # a failure has this status, too
            raise RunFailedError(done[-TEXT_SHOWN:])
        found = json.loads(done)["findings"]
        return {
            "findings": tuple(PlantFinding(**each, is_error=each["severity"] == "error") for each in found)
        }

    async def _simulate(self, folder: Path, name: str, request: PlantRunRequest) -> dict[str, Any]:
        sizes = ",".join(map(str, request.robots))
        options = f"--robots {sizes} --hours {request.hours} --jobs 1 --json done.json".split()
        if request.orders:
            (folder / "orders.csv").write_text(request.orders, encoding="utf-8")
            options += ["--orders", "orders.csv"]
        texts: list[str] = []

        async def figures_of(plant: str) -> tuple[PlantFigures, ...]:
            (folder / "plant.json").write_text(plant, encoding="utf-8")
            report = folder / "done.json"
            report.unlink(missing_ok=True)
            try:
                await _execute(folder, "nena_simulate", "plant.json", *options)
            except RunFailedError as error:
                texts.append(str(error).rpartition("nena simulate: ")[2])
            if not report.exists():
                return ()
            return tuple(map(_figures_of, json.loads(report.read_text(encoding="utf-8"))["figures"]))

        figures = await figures_of(await self._drafts.text(name))
        if not figures:
            raise RunFailedError(*texts)
        active = await figures_of(self._core.engine.plant.to_json())
        return {"figures": figures, "active_figures": active, "texts": tuple(texts)}

    async def _map(self, name: str) -> Any:  # noqa: ANN401 - as _keep_map keeps it
        kept = await self._drafts.result(name, PlantProgram.MAP)
        return json.loads(kept) if kept else None

    async def _write_map(self, folder: Path, name: str) -> str:
        """Write the map of a draft, and return the name of its YAML file."""
        kept = await self._map(name)
        if kept is None:
            raise RunFailedError(NO_MAP)
        (folder / "image").write_bytes(b64decode(kept["image"]))
        file = folder / f"{kept['picture']['name']}.yaml"
        file.write_text(kept["yaml"], encoding="utf-8")
        return file.name


def _figures_of(content: dict[str, Any]) -> PlantFigures:
    """Return figures by path, not by its directions."""
    waiting = Counter[str]()
    for name, minutes in content["waiting_by_place"].items():
        waiting[name.removesuffix(BACKWARD_SUFFIX)] += minutes
    return PlantFigures.model_validate({**content, "waiting_by_place": waiting})


async def _execute(folder: Path, module: str, *arguments: object, good: Collection[int] = (0,)) -> str:
    """Return what a program prints; raises RunFailedError with that unless its status is ``good``."""
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        module,
        *map(str, arguments),
        cwd=folder,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},  # each reserves memory
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        start_new_session=True,
    )
    try:
        with suppress(ProcessLookupError):  # it has ended
            resource.prlimit(process.pid, resource.RLIMIT_AS, (MEMORY, MEMORY))
        with suppress(ProcessLookupError, PermissionError):  # as in deploy/systemd
            os.setpriority(os.PRIO_PROCESS, process.pid, NICENESS)
        printed, errors = await process.communicate()
    finally:
        if process.returncode is None:
            # Its own processes, too
            os.killpg(process.pid, signal.SIGKILL)
            await process.wait()
    text = (printed or errors).decode(errors="replace").strip()
    if process.returncode not in good:
        text = errors.decode(errors="replace").strip() or f"{module} ended with {process.returncode}"
        raise RunFailedError(text[-TEXT_SHOWN:])
    return text
