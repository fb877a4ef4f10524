"""Say in a few lines what was reconstructed and, where the truth is known, how well.

.venv/bin/python -m bench.report FACE.ply REPORT.json [TRUTH.npz]
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np
import open3d as o3d

from denseface.service.tools.evaluation.paper import GROSS_MM
from tests.simulator.truth import Truth

__all__: list[str] = []


def main() -> int:
    """Print points, error and timings."""
    parser = argparse.ArgumentParser(prog="python -m bench.report", description=__doc__)
    parser.add_argument("face", type=Path)
    parser.add_argument("report", type=Path)
    parser.add_argument("truth", type=Path, nargs="?")
    args = parser.parse_args()
    report = json.loads(args.report.read_text())
    print(f"points    {report['initial_points']:,} measured -> {report['dense_points']:,} dense "
          f"(R0 = {report['r0_mm']:.1f} mm, spacing {report['mean_spacing_mm']:.2f} mm)")
    if args.truth and args.truth.exists():
        points = o3d.t.io.read_point_cloud(str(args.face)).point.positions.numpy()
        errors = Truth.load(args.truth).surface_distance(points)
        print(f"error     {errors.mean():.2f} mm mean, {np.std(errors):.2f} mm SD, "
              f"{100 * (errors > GROSS_MM).mean():.2f} % above {GROSS_MM} mm "
              "(paper: 1.31, 1.07, almost none)")
    times = report["timings_ms"]
    stages = ", ".join(f"{name} {ms:.0f}" for name, ms in times.items() if name != "total")
    print(f"time      {times['total']:.0f} ms: {stages}")
    for warning in report["warnings"]:
        print(f"warning   {warning}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
