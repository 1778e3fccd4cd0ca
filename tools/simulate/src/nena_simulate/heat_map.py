"""Heat map of waiting: the plant from above; more waiting is drawn redder and thicker."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape

from nena_shared.plant import BACKWARD_SUFFIX, PlantModel

WIDTH_PX = 1000
MARGIN_PX = 30
COOL, HOT = (252, 196, 25), (201, 42, 42)
"""Colours (RGB) of the least and the most waiting."""


def heat_map(plant: PlantModel, waiting: Mapping[str, float], title: str) -> str:
    """Return an SVG; ``waiting`` has robot minutes per hour by names of paths and points."""
    view, places = _View(plant), dict.fromkeys((*plant.paths_by_name, *plant.points_by_name), 0.0)
    for name, value in waiting.items():
        places[name.removesuffix(BACKWARD_SUFFIX)] += value
    most = max(places.values())
    lines = [*view.paths(places, most), *view.points(places, most)]
    legend = f"{title}; maximum: {most:.1f} robot minutes per hour"
    height = view.height + 2 * MARGIN_PX + 20
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH_PX + 2 * MARGIN_PX} {height:.0f}" '
        'font-family="sans-serif" font-size="14">'
    )
    ground = '<rect width="100%" height="100%" fill="white"/>'
    foot = f'<text x="{MARGIN_PX}" y="{height - 10:.0f}">{escape(legend)}</text>'
    return "\n".join((head, ground, *lines, foot, "</svg>\n"))


class _View:
    """Coordinates of the plant in the picture."""

    def __init__(self, plant: PlantModel) -> None:
        self._plant = plant
        xs, ys = [point.x_mm for point in plant.points], [point.y_mm for point in plant.points]
        self._left, self._top = min(xs), max(ys)
        self._scale = WIDTH_PX / max(max(xs) - min(xs), 1)
        self.height = (max(ys) - min(ys)) * self._scale

    def paths(self, waiting: Mapping[str, float], most: float) -> Iterator[str]:
        """Draw all paths; those with waiting robots last, on top."""
        for drawn in sorted(self._plant.paths, key=lambda each: waiting[each.name]):
            name, value = drawn.name, waiting[drawn.name]
            (x1, y1), (x2, y2) = self._place_of(drawn.source), self._place_of(drawn.destination)
            tooltip = f"<title>{escape(name)}: {value:.1f}</title>"
            ends = f'x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"'
            yield f"<line {ends} {_pen_for(value, most)}>{tooltip}</line>"

    def points(self, waiting: Mapping[str, float], most: float) -> Iterator[str]:
        """Draw stations and points at which robots wait."""
        for location in self._plant.locations:
            for link in location.links:
                x, y = self._place_of(link.point)
                yield (
                    f'<rect x="{x - 5:.1f}" y="{y - 5:.1f}" width="10" height="10" fill="none" '
                    f'stroke="#1864ab"><title>{escape(location.name)}</title></rect>'
                )
        for point in self._plant.points:
            if value := waiting[point.name]:
                x, y = self._place_of(point.name)
                share = value / most
                tooltip = f"<title>{escape(point.name)}: {value:.1f}</title>"
                yield (
                    f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{3 + 7 * share:.1f}" fill="{_colour_for(share)}">'
                    f"{tooltip}</circle>"
                )

    def _place_of(self, point: str) -> tuple[float, float]:
        found = self._plant.point(point)
        return (
            MARGIN_PX + (found.x_mm - self._left) * self._scale,
            MARGIN_PX + (self._top - found.y_mm) * self._scale,
        )


def _pen_for(value: float, most: float) -> str:
    if not value:
        return 'stroke="#ced4da" stroke-width="2"'
    share = value / most
    return f'stroke="{_colour_for(share)}" stroke-width="{3 + 7 * share:.1f}" stroke-linecap="round"'


def _colour_for(share: float) -> str:
    mixed = (round(cool + (hot - cool) * share) for cool, hot in zip(COOL, HOT, strict=True))
    return "#" + "".join(f"{each:02x}" for each in mixed)
