"""Stage 5, `best` preset: as much smoothing in each place as the face there allows.

One smoothing for the whole face is a compromise: cheeks and forehead could bear more of it, lips
and eyelids less. Two fits are blended, a fine and a coarse one, by the local Wiener gain of Lee,
1980, doi:10.1109/TPAMI.1980.4766994: where what the fine fit adds is no stronger than noise, it
is left out.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recon._image_kernels import blend
from recon.rbf import Surface
from recon.support import support_on_grid

__all__ = ["AdaptiveSurface", "blend_surfaces"]

# Over what radius detail counts as local (standard deviation).
_WINDOW_MM = 6.0
# The smoothest part of a face shows what noise alone adds to the fine fit.
_NOISE_PERCENTILE = 20


@dataclass(frozen=True, eq=False)
class AdaptiveSurface:
    """Two fits and how much of the fine one's detail to take: z = coarse + gain (fine - coarse).

    Attributes
    ----------
    fine, coarse : the fits, mm, depth camera frame
    gain : (rows, columns) float32, 0-1, on a grid that begins at `origin`
    origin : (x, y) of the gain grid's first point, mm
    step : distance of its points, mm
    """

    fine: Surface
    coarse: Surface
    gain: NDArray[np.float32]
    origin: tuple[float, float]
    step: float

    @property
    def noise(self) -> float:
        """Standard deviation of the seeds about the fine fit, mm."""
        return self.fine.noise

    def on_grid(self, xs: NDArray[np.float64], ys: NDArray[np.float64]) -> NDArray[np.float64]:
        """Evaluate on an axis-aligned grid: (k,), (m,) mm -> (m, k) mm."""
        coarse = self.coarse.on_grid(xs, ys)
        return coarse + self._gain(xs, ys) * (self.fine.on_grid(xs, ys) - coarse)

    def sampled(
        self, xs: NDArray[np.float64], ys: NDArray[np.float64]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """Give f, df/dx, df/dy on an axis-aligned grid at once, in single precision.

        As `Surface.sampled`: (k,), (m,) mm -> (m, k) each. The gain varies slowly beside the
        heights: its own slope is left out.
        """
        found = self.fine.sampled(xs, ys)
        columns, rows = self._places(xs, 0), self._places(ys, 1)
        for one, other in zip(found, self.coarse.sampled(xs, ys), strict=True):
            blend(one, other, self.gain, rows, columns)
        return found

    def _gain(self, xs: NDArray[np.float64], ys: NDArray[np.float64]) -> NDArray[np.float32]:
        """The gain, bilinear: (k,), (m,) mm -> (m, k)."""
        gain = np.ones((len(ys), len(xs)), np.float32)
        blend(gain, np.zeros_like(gain), self.gain, self._places(ys, 1), self._places(xs, 0))
        return gain

    def _places(self, values: NDArray[np.float64], axis: int) -> NDArray[np.float32]:
        """Where on the gain's grid, in its points, kept inside it."""
        places = (values - self.origin[axis]) / self.step
        return np.clip(places, 0, self.gain.shape[1 - axis] - 1).astype(np.float32)


def blend_surfaces(
    fine: Surface, coarse: Surface, points: NDArray[np.float32], spacing: float
) -> AdaptiveSurface:
    """Find where the fine fit's detail is more than noise.

    Parameters
    ----------
    fine, coarse : two fits of `points`
    points : (n, 3) float32, mm, depth camera frame
    spacing : mean spacing of the points, mm
    """
    xs, ys, support = support_on_grid(points, spacing, spacing)
    detail = (fine.on_grid(xs, ys) - coarse.on_grid(xs, ys)).astype(np.float32) * support
    covered = _local_sum(support.astype(np.float32), spacing)
    energy = _local_sum(detail * detail, spacing) / np.maximum(covered, np.float32(1e-6))
    noise = np.percentile(energy[support], _NOISE_PERCENTILE) if support.any() else 0.0
    gain = np.clip(1 - noise / np.maximum(energy, 1e-12), 0, 1).astype(np.float32)
    return AdaptiveSurface(fine, coarse, gain, (float(xs[0]), float(ys[0])), spacing)


def _local_sum(image: NDArray[np.float32], step: float) -> NDArray[np.float32]:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), _WINDOW_MM / step,
                                       borderType=cv2.BORDER_CONSTANT), np.float32)
