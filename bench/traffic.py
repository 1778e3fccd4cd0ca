"""Orders per minute of a backlog that never empties, simulated with the real order service.

In five halls, and the median of sites by lot; beside it PIBT in lock-step with the same robots, starts and
orders, and robots that never meet.
"""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from pathlib import Path
from statistics import fmean, median

from bench.halls import HALLS, SPEED_MM_S, Hall, demo_is_there
from bench.pibt import WORK_SECONDS, bound, orders_per_minute
from bench.programs import Figures, Version
from bench.sites import site

CASES = {"aisles": (20, 50), "spurs": (50,), "two_halls": (20,), "demo_01": (4,), "road_map": (50,)}
SITE_FLEETS = tuple(map(int, os.environ.get("NENA_TRAFFIC_SITE_FLEETS", "6,13,25,51").split(",")))
SITES = range(1, 1 + int(os.environ.get("NENA_TRAFFIC_SITES", "3")))
MINUTES = float(os.environ.get("NENA_TRAFFIC_MINUTES", "4"))
WARM_UP = 1.0
SEEDS = tuple(map(int, os.environ.get("NENA_TRAFFIC_SEEDS", "1,2,3").split(",")))


def measure_traffic(version: Version) -> Figures:
    """Return orders per minute of each case (mean over the seeds), beside PIBT."""
    figures: Figures = {}
    for name, fleets in CASES.items():
        if name == "demo_01" and not demo_is_there():
            continue
        hall = HALLS[name]()
        for robots in fleets:
            case = f"{name}_{robots}"
            figures[f"{case}_per_minute"] = fmean(_simulate(version, hall, robots, seed) for seed in SEEDS)
            figures[f"{case}_pibt_per_minute"] = orders_per_minute(hall, robots)
            figures[f"{case}_never_meet_per_minute"] = bound(hall, robots)
    for robots in SITE_FLEETS:
        halls = [site(number) for number in SITES]
        found = [_simulate(version, hall, robots, SEEDS[0]) for hall in halls]
        figures[f"sites_{robots}_per_minute"] = median(found)
        bounds = [bound(hall, robots, turns=True) for hall in halls]
        figures[f"sites_{robots}_never_meet_per_minute"] = median(bounds)
    return figures


def _simulate(version: Version, hall: Hall, robots: int, seed: int) -> float:
    with tempfile.TemporaryDirectory(prefix="nena-bench-") as name:
        folder = Path(name)
        plant, orders, report = folder / "plant.json", folder / "orders.csv", folder / "report.json"
        plant.write_text(hall.plant.to_json(), encoding="utf-8")
        pairs = ((one, other) for one in hall.stations for other in hall.stations if one != other)
        rows = "".join(f"{source},{destination},1\n" for source, destination in pairs)
        orders.write_text(f"from,to,per_hour\n{rows}", encoding="utf-8")
        command = [version.program("nena"), "simulate", str(plant), "--robots", str(robots)]
        command += ["--orders", str(orders), "--backlog", str(max(5, robots // 2)), "--seed", str(seed)]
        command += ["--hours", str(MINUTES / 60), "--warm-up", str(WARM_UP), "--jobs", "1"]
        command += ["--speed", str(SPEED_MM_S / 1000), "--work", str(WORK_SECONDS), "--json", str(report)]
        subprocess.run(
            command, check=True, stdout=subprocess.DEVNULL, env={**os.environ, "PYTHONHASHSEED": "0"}
        )
        (fleet,) = json.loads(report.read_text(encoding="utf-8"))["figures"]
        return float(fleet["orders_per_hour"]) / 60
