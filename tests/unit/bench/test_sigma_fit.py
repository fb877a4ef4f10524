import numpy as np
import pytest

from bench.calibration_samples import Samples
from bench.sigma_fit import fitted
from denseface.recon import Preset

COUNT = 60_000
DETAILED = (1.2, 0.8, 2.0, 0.1, 0.2, 0.5, 1.5)
FIT_ALONE = (2.0, 1.5, 1.0, 0.4, 0.3, 1.5, 2.5)


def made_up(coefficients: tuple[float, ...], seed: int) -> Samples:
    """Errors drawn from a normal distribution of the very form that is fitted."""
    rng = np.random.default_rng(seed)
    components = rng.gamma(0.3, [1.0, 1.0, 1.0, 3.0, 3.0, 1.0, 1.0], (COUNT, 7))
    sigma = np.sqrt(components @ coefficients + 1e-6)
    everything = np.ones(COUNT, bool)
    return Samples(error=rng.normal(0, sigma), distance=np.full(COUNT, np.nan), sigma=sigma,
                   z=np.full(COUNT, 700.0), components=components, hole=~everything,
                   rim=rng.random(COUNT) < 0.1, everywhere=everything)


def test_the_coefficients_that_made_the_errors_are_found():
    found = fitted({Preset.BEST: made_up(DETAILED, 0), Preset.FAITHFUL: made_up(FIT_ALONE, 1),
                    Preset.PAPER: made_up(FIT_ALONE, 2)})
    assert found == {"_DETAILED": pytest.approx(DETAILED, rel=0.2, abs=0.05),
                     "_FIT_ALONE": pytest.approx(FIT_ALONE, rel=0.2, abs=0.05)}
