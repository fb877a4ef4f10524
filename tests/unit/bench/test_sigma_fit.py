import numpy as np
import pytest

from bench.calibration_samples import Samples
from bench.sigma_fit import fitted
from denseface.recon import Preset, Settings
from denseface.recon.propagation.uncertainty import averaging_cutoff, fit_cutoff, noise_fraction

COUNT = 60_000
HOLE, SLOPE, RIM, RIM_ALONE, SHARE, DETAIL_PART = 0.8, 0.1, 2.0, 3.0, 50.0, 0.6


def made_up(preset: Preset, seed: int) -> Samples:
    """Errors drawn from a normal distribution of the very form that is fitted."""
    rng = np.random.default_rng(seed)
    components = rng.gamma(1.0, [1.0, 0.5, 3.0, 0.2], (COUNT, 4))
    settings = Settings.of(preset)
    share = SHARE * fit_cutoff(settings.r0_factor, settings.smoothing) ** 2
    if settings.detail_factor is not None:
        share += DETAIL_PART * SHARE * averaging_cutoff(settings.detail_factor) ** 2
    rim = RIM if settings.detail_factor else RIM_ALONE
    sigma = np.sqrt(components @ [share, share * HOLE, SLOPE, rim])
    everything = np.ones(COUNT, bool)
    return Samples(error=rng.normal(0, sigma), distance=np.full(COUNT, np.nan), sigma=sigma,
                   z=np.full(COUNT, 700.0), components=components, hole=~everything,
                   rim=rng.random(COUNT) < 0.1, everywhere=everything)


def test_the_coefficients_that_made_the_errors_are_found():
    found = fitted({preset: made_up(preset, seed) for seed, preset in enumerate(Preset)})
    expected = {"_HOLE": HOLE, "_SLOPE": SLOPE, "_RIM": RIM, "_RIM_FIT_ALONE": RIM_ALONE,
                "_FIT_FRACTION": SHARE, "_DETAIL_FRACTION": DETAIL_PART}
    assert found.keys() == expected.keys()
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, rel=0.12), name


def test_the_share_is_computed_as_it_is_fitted():
    """One fit: in proportion to the squared cut-off."""
    paper, faithful = Settings.of("paper"), Settings.of("faithful")
    squares = [fit_cutoff(one.r0_factor, one.smoothing) ** 2 for one in (paper, faithful)]
    ratio = noise_fraction(paper) / noise_fraction(faithful)
    assert ratio == pytest.approx(squares[0] / squares[1])
