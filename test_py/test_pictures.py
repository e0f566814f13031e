"""Pictures of the documentation: small, and the same as `tools/pictures.py` draws from all samples of a new run."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tools"))

import pictures  # noqa: E402  (its folder is added before)

MOST_BYTES = 50_000
CURVES = {
    "ballbar.svg": 3,
    "contrast.svg": 4,
    "figure-5.svg": 1,
    "figure-6.svg": 4,
    "figure-7.svg": 4,
    "figure-8-a.svg": 3,
    "figure-8-b.svg": 3,
    "figure-8-c.svg": 3,
    "figure-8-d.svg": 4,
    "figure-10.svg": 2,
    "figure-11.svg": 6,
}
"""Number of the curves of each picture."""
HALF_PIXEL = 0.75 / 2
"""Half a pixel in points, the unit of the files."""


def distance(points: np.ndarray, line: np.ndarray) -> float:
    """Returns the largest distance of the points to a polyline."""
    # In parts, as each takes memory for every point and segment.
    parts = np.array_split(points, len(points) // 500 + 1)
    return max(pictures.distance_to_segments(part, line).max() for part in parts)


def difference(one: Path, other: Path) -> dict[str, float]:
    """Returns the largest distance between each curve of two pictures, points."""
    curves, others = (pictures.curves(path.read_text()) for path in (one, other))
    assert curves.keys() == others.keys()
    return {name: max(distance(curve, others[name]), distance(others[name], curve)) for name, curve in curves.items()}


def texts(path: Path) -> list[str]:
    """Returns the texts of a picture."""
    return re.findall(r"<text[^>]*>([^<]*)</text>", path.read_text())


@pytest.mark.parametrize(("name", "count"), list(CURVES.items()))
def test_stored_picture(name: str, count: int, tmp_path: Path):
    """A stored picture is small, has a white background, and each curve within half a pixel of all samples."""
    stored = pictures.IMAGES / name
    svg = stored.read_text()
    assert stored.stat().st_size < MOST_BYTES
    width, height = re.search(r'viewBox="0 0 (\S+) (\S+)"', svg).groups()
    first = re.search(r"<path[^>]*>", svg[svg.index("</defs>") :])
    assert first[0] == f'<path d="M0 {height}L{width} {height}L{width} 0L0 0z" style="fill: #ffffff"/>'
    every_sample = tmp_path / name
    pictures.write(name, every_sample, tolerance=0)
    distances = difference(stored, every_sample)
    assert len(distances) == count and max(distances.values()) < HALF_PIXEL, distances
    assert texts(stored) == texts(every_sample)


def test_a_different_curve_is_found(tmp_path: Path):
    """Another tuning changes the curves of predictive control by more than half a pixel."""
    pictures.write("contrast.svg", tmp_path / "other.svg", tuning={**pictures.TUNING, "lambda_rel": 0.45})
    distances = difference(pictures.IMAGES / "contrast.svg", tmp_path / "other.svg")
    assert min(distances["circle-gpc"], distances["corner-gpc"]) > HALF_PIXEL, distances


def test_simplified_curve_keeps_its_extremes():
    """A simplified curve has fewer points, and every sample within the tolerance."""
    time = np.linspace(0, 20, 2001)
    wave = np.column_stack([10 * time, 30 * np.sin(time) + 5 * np.exp(-((time - 10) ** 2) * 100)])
    kept = pictures.simplified(wave, 0.15)
    assert len(kept) < len(wave) / 10 and {0, 2000} <= set(kept)
    assert pictures.distance_to_segments(wave, wave[kept]).max() <= 0.15
