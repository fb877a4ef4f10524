"""Show every face in the viewer of rerun (https://rerun.io) as it is published.

    pip install rerun-sdk
    python to_rerun.py                 # opens the viewer; until Ctrl-C
    python to_rerun.py faces.rrd 5     # writes the last five faces to a file instead

The hub is that of DENSEFACE_ADDRESS, with the keys of DENSEFACE_KEY and DENSEFACE_HUB_KEY.
"""

import sys
from contextlib import suppress
from itertools import islice

import rerun as rr

from denseface import Client, Face


def log(face: Face, number: int) -> None:
    """Log what was measured and what was made of it, in metres: x right, y down, z forward."""
    dense, initial, report = face.dense, face.initial, face.report
    rr.set_time("face", sequence=number)
    if report.captured_at:
        rr.set_time("captured", timestamp=report.captured_at)
    rr.log("/", rr.ViewCoordinates.RDF, static=True)
    radius = dense.grid_step_mm / 2000
    rr.log("dense", rr.Points3D(dense.points / 1000, colors=dense.colors, radii=radius),
           rr.AnyValues(sigma_mm=dense.sigma))
    rr.log("measured", rr.Points3D(initial.points / 1000, colors=initial.colors, radii=radius))
    rr.log("report", rr.TextDocument(report.model_dump_json(indent=2)))


def main(path: str | None = None, last: str | None = None) -> None:
    """Follow the faces, for ever or for so many."""
    rr.init("denseface", spawn=path is None)
    if path is not None:
        rr.save(path)
    count = None if last is None else int(last)
    with suppress(KeyboardInterrupt), Client() as client:
        for number, face in enumerate(islice(client.faces(last=count), count)):
            log(face, number)
            print(f"{face.report.capture_id}: {len(face.dense)} points")
    rr.disconnect()


if __name__ == "__main__":
    main(*sys.argv[1:])
