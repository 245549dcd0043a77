"""The growth of costs as one SVG: a panel for each thing that grows, both axes logarithmic."""

import math
from html import escape

# Colours that the colour-blind can tell apart (Okabe and Ito).
COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7"]
WIDTH, HEIGHT, MARGIN = 360, 260, 50


def picture(rows: list[dict], rates: dict[int, float]) -> str:
    panels: dict[str, list[tuple[str, dict]]] = {}
    for row in rows:
        panels.setdefault(row["by"], []).append((row["name"], row["instructions"]))
    drawn = [panel(by, "instructions", curves) for by, curves in panels.items()]
    drawn.append(panel("threads", "runs per second", [("Monte Carlo, model level", rates)]))
    columns = 3
    width, height = columns * WIDTH, -(-len(drawn) // columns) * HEIGHT
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        f'font-family="sans-serif" font-size="11"><rect width="100%" height="100%" fill="white"/>'
    ]
    for index, part in enumerate(drawn):
        x, y = index % columns * WIDTH, index // columns * HEIGHT
        parts.append(f'<g transform="translate({x} {y})">{part}</g>')
    return "\n".join(parts) + "\n</svg>\n"


def panel(by: str, unit: str, curves: list[tuple[str, dict]]) -> str:
    sizes = sorted({size for _, curve in curves for size in curve})
    values = [value for _, curve in curves for value in curve.values()]
    low, high = 10 ** math.floor(math.log10(min(values))), 10 ** math.ceil(math.log10(max(values)))
    legend = 14 * len(curves)

    def x(size: float) -> float:
        span = math.log(sizes[-1] / sizes[0]) or 1
        return MARGIN + (WIDTH - MARGIN - 20) * math.log(size / sizes[0]) / span

    def y(value: float) -> float:
        top, bottom = 14 + legend, HEIGHT - 36
        return bottom - (bottom - top) * math.log(value / low) / math.log(high / low)

    parts = []
    for size in sizes:
        parts.append(f'<text x="{x(size):.1f}" y="{HEIGHT - 22}" text-anchor="middle">{size}</text>')
    decade = low
    while decade <= high:
        at, power = y(decade), round(math.log10(decade))
        parts.append(f'<path d="M{MARGIN} {at:.1f}H{WIDTH - 20}" stroke="#ddd"/>')
        parts.append(f'<text x="{MARGIN - 5}" y="{at + 4:.1f}" text-anchor="end">1e{power}</text>')
        decade *= 10
    for index, (name, curve) in enumerate(curves):
        colour = COLOURS[index % len(COLOURS)]
        points = " ".join(f"{x(size):.1f},{y(value):.1f}" for size, value in curve.items())
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"/>')
        for point in points.split():
            cx, cy = point.split(",")
            parts.append(f'<circle cx="{cx}" cy="{cy}" r="3" fill="{colour}"/>')
        parts.append(f'<text x="{MARGIN}" y="{14 + 14 * index}" fill="{colour}">{escape(name)}</text>')
    middle = (WIDTH + MARGIN) / 2
    parts.append(f'<text x="{middle}" y="{HEIGHT - 6}" text-anchor="middle">{escape(by)}</text>')
    parts.append(f'<text transform="translate(12 {HEIGHT / 2}) rotate(-90)" text-anchor="middle">{unit}</text>')
    return "".join(parts)
