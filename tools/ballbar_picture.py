#!/usr/bin/env python3
"""Draws docs/images/ballbar.svg, the picture of README.md: a ballbar with each position controller, without ROS.

Needs `cargo build --release` and `source .build/env.sh`. ./demo.sh draws the same over ROS 2.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

import options
import pictures

sys.path.insert(0, str(pictures.ROOT / "test_py"))
from polar_chart import Circle, draw  # noqa: E402  (the path to it is set above)

PICTURE = pictures.IMAGES / "ballbar.svg"
TITLE = "Ballbar: radial deviation over the polar angle"
CONTROLLERS = {
    "cascade with feedforward": "cascade",
    "cascade without feedforward": "cascade-noff",
    "predictive control": "gpc",
}


def figure() -> Figure:
    """Runs the ballbars and draws them."""
    circles = {}
    for title, controller in CONTROLLERS.items():
        figures, trace = pictures.ballbar("--controller", controller)
        (circle,) = figures["circles"]
        circles[title] = Circle(
            trace["angle"],
            trace["deviation"],
            mean=circle["radial_deviation_um"]["mean"],
            circular_deviation=circle["circular_deviation_um"],
        )
        print(f"{title:27}  mean {circles[title].mean:+.1f} µm, G {circles[title].circular_deviation:.1f} µm")
    return draw(circles)


def write(path: Path, tolerance: float = pictures.TOLERANCE) -> None:
    """Writes the picture."""
    with plt.rc_context(pictures.STYLE):
        pictures.save(figure(), path, TITLE, tolerance)


def main() -> int:
    """Draws the picture."""
    options.parser(__doc__).parse_args()
    write(PICTURE)
    print(f"picture    {PICTURE.relative_to(pictures.ROOT)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
