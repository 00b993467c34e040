"""Pictures of results: a figure of matplotlib, and what a notebook shows at once. The pixels come from the compiled part."""

from __future__ import annotations

import base64
import html
import struct
import zlib
from typing import Any

import numpy as np

from . import _nurbskin
from ._errors import Error

#: Colours of deviations from -1 to 1 times the limit: blue inside, white, red outside (ColorBrewer's RdBu, 5 classes).
STOPS = np.array([[5, 113, 176], [146, 197, 222], [247, 247, 247], [244, 165, 130], [202, 0, 32]], dtype=float)
#: Colours below and above a tolerance.
UNDER, OVER = np.array([84, 39, 136], dtype=float), np.array([255, 196, 0], dtype=float)
#: Colour of a surface without data, and of one without a comparison.
NO_DATA, PLAIN = np.array([150, 150, 155], dtype=float), np.array([150, 175, 205], dtype=float)
#: Pixels of the picture in a notebook: width and height.
SIZE = (480, 360)
#: Pixels along each side that make one of the picture, so that edges are smooth.
FINER = 2
#: Where the viewer stands, in degrees, unless said otherwise.
ELEVATION, AZIMUTH = 30.0, -60.0


def _limit(shown: Any) -> float:
    """The deviation at the end of the colours: the tolerance, or that of 99 % of the points."""
    if shown.tolerance is not None:
        return float(shown.tolerance)
    statistics = shown.deviation().statistics
    return statistics["p99"] or statistics["max"] or 1.0


def colours(values: Any, limit: float, has_tolerance: bool) -> Any:
    """Colours (..., 3) from 0 to 255 of signed deviations."""
    share = np.asarray(values) / limit
    place = (np.clip(np.nan_to_num(share), -1, 1) + 1) / 2 * (len(STOPS) - 1)
    below = np.minimum(place.astype(int), len(STOPS) - 2)
    part = (place - below)[..., None]
    found = (1 - part) * STOPS[below] + part * STOPS[below + 1]
    if has_tolerance:
        found[share < -1] = UNDER
        found[share > 1] = OVER
    found[np.isnan(share)] = NO_DATA
    return found


def picture(shown: Any, size: tuple[int, int], elevation: float, azimuth: float) -> Any:
    """The trimmed faces of a result, a comparison or a model from afar: (height, width, 4) bytes, red to alpha."""
    mesh = shown._mesh()
    has_data = "deviation" in mesh
    values = mesh["deviation"] if has_data else np.zeros(len(mesh["points"]))
    width, height = size[0] * FINER, size[1] * FINER
    values, light = _nurbskin.render(
        mesh["points"], mesh["triangles"], mesh["normals"], values, width, height, elevation, azimuth
    )
    tolerance = getattr(shown, "tolerance", None)
    colour = colours(values, _limit(shown), tolerance is not None) if has_data else np.broadcast_to(PLAIN, (*values.shape, 3))
    seen = light > 0
    drawn = np.dstack([colour * light[..., None], np.where(seen, 255.0, 0.0)])
    drawn[~seen] = 0
    # The colour of a pixel is that of the part of it which is covered.
    whole = drawn.reshape(size[1], FINER, size[0], FINER, 4).mean(axis=(1, 3))
    covered = whole[..., 3:] / 255
    whole[..., :3] /= np.where(covered > 0, covered, 1)
    return np.clip(np.rint(whole), 0, 255).astype(np.uint8)


def png(image: Any) -> bytes:
    """A picture as a PNG file (W3C, Portable Network Graphics, 3rd ed.): colour type 6, 8 bits, filter Sub."""
    height, width = image.shape[:2]

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    # Each byte less that of the pixel before it, modulo 256, which compresses better.
    less = image.copy()
    less[:, 1:] -= image[:, :-1]
    rows = np.hstack([np.ones((height, 1), np.uint8), less.reshape(height, -1)])
    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    parts = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows.tobytes(), 9)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + parts


def plot(shown: Any, elevation: float, azimuth: float, figure: Any) -> Any:
    """The picture of a result or a comparison beside the histogram of its deviations."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize

    if figure is None:
        from matplotlib import pyplot

        figure = pyplot.figure(figsize=(11, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[3, 2])
    left.imshow(picture(shown, (900, 720), elevation, azimuth))
    left.set_axis_off()
    left.set_title(f"verdict: {shown.verdict}")
    limit, tolerance = _limit(shown), shown.tolerance
    scale: Colormap = LinearSegmentedColormap.from_list("deviation", STOPS / 255)
    if tolerance is not None:
        under, over = ("#" + bytes(colour.astype(np.uint8)).hex() for colour in (UNDER, OVER))
        scale = scale.with_extremes(under=under, over=over)
    mappable = ScalarMappable(Normalize(-limit, limit), scale)
    extend = "neither" if tolerance is None else "both"
    figure.colorbar(mappable, ax=left, shrink=0.8, extend=extend, label=f"deviation, {shown.unit}; grey: no data")
    right.hist(shown.deviation().signed, bins=61, color=tuple(PLAIN / 255))
    for place in [] if tolerance is None else [-tolerance, tolerance]:
        right.axvline(place, color="black", linestyle="--", linewidth=1)
    right.set_xlabel(f"deviation, {shown.unit}" + ("" if tolerance is None else f"; dashed: tolerance {tolerance:.4g}"))
    right.set_ylabel("points")
    return figure


def _html(shown: Any, title: str, rows: list[tuple[str, str]], key: str | None) -> str:
    """A picture and a table of figures."""
    try:
        image = base64.b64encode(png(picture(shown, SIZE, ELEVATION, AZIMUTH))).decode("ascii")
        left = f'<img alt="{html.escape(title, quote=True)}" width="{SIZE[0]}" height="{SIZE[1]}" src="data:image/png;base64,{image}">'
    except Error as why:
        # The figures stand without it.
        left = f"<p>{html.escape(str(why))}</p>"
    if key is not None:
        gradient = ", ".join(f"rgb({r:.0f},{g:.0f},{b:.0f})" for r, g, b in STOPS)
        left += (
            f'<div style="width:{SIZE[0]}px;height:10px;background:linear-gradient(to right, {gradient})"></div>'
            f"<div>{html.escape(key)}</div>"
        )
    table = "".join(
        f'<tr><th style="text-align:left">{html.escape(name)}</th><td style="text-align:left">{html.escape(text)}</td></tr>'
        for name, text in rows
    )
    return f'<div style="display:flex;flex-wrap:wrap;gap:1em"><div>{left}</div><table><caption>{html.escape(title)}</caption>{table}</table></div>'


def _deviation_rows(shown: Any) -> list[tuple[str, str]]:
    statistics, unit = shown.deviation().statistics, shown.unit
    rows = [
        ("verdict", shown.verdict),
        ("reason", shown.reason),
        ("points", f"{statistics['count']}"),
        ("95 % within", f"{statistics['p95']:.4g} {unit}"),
        ("largest distance", f"{statistics['max']:.4g} {unit}"),
    ]
    if shown.tolerance is not None:
        rows.append(("tolerance", f"{shown.tolerance:.4g} {unit}"))
        rows.append(("within it", f"{100 * statistics['within_tolerance']:.4g} %"))
    return rows


def _key(shown: Any) -> str:
    limit = f"{_limit(shown):.4g} {shown.unit}"
    beyond = "" if shown.tolerance is None else "; beyond it purple and yellow"
    return f"blue: {limit} inside, red: {limit} outside{beyond}; grey: no data"


def result_to_html(result: Any) -> str:
    """A result as a notebook shows it."""
    rows = _deviation_rows(result)
    faces = len(result.surfaces)
    count = sum(s.control_points.shape[0] * s.control_points.shape[1] for s in result.surfaces)
    rows.append(("surfaces", f"{faces}, of {count} control points"))
    rows.append(("full report", "result.page(), or result.report(\"part.html\")"))
    return _html(result, "nurbskin fit", rows, _key(result))


def comparison_to_html(comparison: Any) -> str:
    """A comparison as a notebook shows it."""
    rows = _deviation_rows(comparison)
    covered = 1 - comparison.summary["deviation"]["surface_to_scan"]["unsupported_area"]
    rows.append(("area with data", f"{100 * covered:.4g} %"))
    rows.append(("full report", "comparison.page(), or comparison.report(\"part.html\")"))
    return _html(comparison, "deviation from the model", rows, _key(comparison))


def model_to_html(model: Any) -> str:
    """A CAD model as a notebook shows it."""
    low, high = model.bounds
    size = " x ".join(f"{side:.4g}" for side in high - low)
    rows = [
        ("faces", str(len(model))),
        ("size", f"{size} {model.unit}"),
        ("area", f"{model.area:.6g} {model.unit}²"),
        ("closed", "yes" if model.closed else "no"),
    ]
    if model.volume is not None:
        rows.append(("volume", f"{model.volume:.6g} {model.unit}³"))
    return _html(model, "CAD model", rows, None)
