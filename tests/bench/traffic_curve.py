"""Draws orders per minute over robots from the figures of ``make bench ENTRIES=traffic``.

``PYTHONPATH=tests python -m bench.traffic_curve docs/traffic.json docs/traffic.svg``; ``--before FILE`` adds
the curve of an older version.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

Curve = Mapping[int, float]

WIDTH, HEIGHT, MARGIN = 440, 300, 50
HALLS = {"aisles": "stations on the aisles", "spurs": "stations on spurs"}
STYLES = {
    "never meet": "#868e96",
    "PIBT": "#1864ab",
    "PIBT, turning": "#74c0fc",
    "NeNa": "#c92a2a",
    "NeNa, real programs": "#7048e8",
    "NeNa before": "#f08c00",
}


def curves(figures: Mapping[str, Any], before: Mapping[str, Any]) -> dict[str, dict[int, float]]:
    """Return the curves of one hall by name; numbers of robots without a figure are left out."""
    sources = {
        "never meet": (figures, "never_meet"),
        "PIBT": (figures, "pibt"),
        "PIBT, turning": (figures, "pibt_turning"),
        "NeNa": (figures, "simulated"),
        "NeNa, real programs": (figures, "orders_per_minute"),
        "NeNa before": (before, "simulated"),
    }
    found = {
        name: {int(robots): one[key] for robots, one in of.items() if key in one}
        for name, (of, key) in sources.items()
    }
    return {name: dict(sorted(curve.items())) for name, curve in found.items() if curve}


def picture(halls: Mapping[str, Mapping[str, Curve]]) -> str:
    """Return an SVG with a diagram for each hall."""
    width = len(halls) * (WIDTH + MARGIN) + MARGIN
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {HEIGHT + 3 * MARGIN}" '
        'font-family="sans-serif" font-size="12">'
    )
    parts = [head, '<rect width="100%" height="100%" fill="white"/>']
    for number, (name, found) in enumerate(halls.items()):
        parts.append(f'<g transform="translate({MARGIN + number * (WIDTH + MARGIN)} {MARGIN})">')
        parts.append(f'<text x="0" y="-20">Orders per minute over robots, {HALLS.get(name, name)}</text>')
        parts += [*_diagram(found), "</g>"]
    for number, (name, colour) in enumerate(STYLES.items()):
        x, y = MARGIN + number * 150, HEIGHT + 2 * MARGIN + 20
        parts.append(f'<path d="M{x} {y - 4} h24" stroke="{colour}" stroke-width="2"/>')
        parts.append(f'<text x="{x + 30}" y="{y}">{name}</text>')
    return "\n".join((*parts, "</svg>\n"))


def _diagram(found: Mapping[str, Curve]) -> Iterator[str]:
    most_robots = max(robots for curve in found.values() for robots in curve)
    most = max(rate for curve in found.values() for rate in curve.values())
    yield f'<path d="M0 0 V{HEIGHT} H{WIDTH}" fill="none" stroke="black"/>'
    for robots in range(0, most_robots + 1, 10):
        yield f'<text x="{robots / most_robots * WIDTH - 6:.0f}" y="{HEIGHT + 18}">{robots}</text>'
    for mark in range(0, int(most) + 1, 20):
        y = HEIGHT - mark / most * HEIGHT
        yield f'<text x="-28" y="{y + 4:.0f}">{mark}</text>'
        yield f'<path d="M0 {y:.0f} H{WIDTH}" stroke="#dee2e6"/>'
    for name, curve in found.items():
        places = [(n / most_robots * WIDTH, HEIGHT - rate / most * HEIGHT) for n, rate in curve.items()]
        line = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
        yield f'<polyline points="{line}" fill="none" stroke="{STYLES[name]}" stroke-width="2"/>'
        for (x, y), (robots, rate) in zip(places, curve.items(), strict=True):
            told = f"<title>{name}, {robots} robots: {rate}</title>"
            yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{STYLES[name]}">{told}</circle>'


def main() -> None:
    """Draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("figures", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--before", type=Path, help="bench.json of an older NeNa")
    arguments = parser.parse_args()
    now = json.loads(arguments.figures.read_text(encoding="utf-8"))["traffic"]
    older = json.loads(arguments.before.read_text(encoding="utf-8"))["traffic"] if arguments.before else {}
    drawn = {name: curves(now[name], older.get(name, {})) for name in HALLS if name in now}
    arguments.picture.write_text(picture(drawn), encoding="utf-8")


if __name__ == "__main__":
    main()
