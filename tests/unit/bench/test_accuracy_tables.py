import numpy as np
import pytest

from bench.accuracy_tables import (
    PAPER_MEAN_MM,
    PAPER_SD_MM,
    deviation_mm,
    distribution,
    distribution_table,
    error_table,
    gathered,
    paper_distribution,
    points_table,
    quality_table,
)
from denseface.recon import Preset
from denseface.service.tools.evaluation.paper import ERROR_BINS_MM
from tests.simulator.accuracy import Accuracy

MIDDLES = (ERROR_BINS_MM[1:] + ERROR_BINS_MM[:-1]) / 2
WIDTHS = np.diff(ERROR_BINS_MM)


def face(errors: np.ndarray, initial: int = 10) -> Accuracy:
    per_mm = np.histogram(errors, ERROR_BINS_MM)[0] / (len(errors) * WIDTHS)
    return Accuracy(initial, len(errors), float(errors.mean()), float(errors.std()), 1.5,
                    float((errors > 5.5).mean()), 0.95, 0.004, 0.0, per_mm)


ONE, OTHER = face(np.array([0.22, 0.22, 1.02, 2.62])), face(np.array([0.62, 0.82, 1.42, 9.0]))
RESULTS = {"a recording": {Preset.BEST: [ONE], Preset.PAPER: [OTHER]},
           "a sensor": {Preset.BEST: [OTHER, OTHER], Preset.PAPER: [ONE]}}


def test_frames_of_as_many_points_deviate_as_all_their_points_do():
    together = np.array([0.22, 0.22, 1.02, 2.62, 0.62, 0.82, 1.42, 9.0])
    assert deviation_mm([ONE, OTHER]) == pytest.approx(together.std())
    assert distribution([ONE, OTHER]) == pytest.approx(face(together).per_mm)


def test_frames_of_recordings_and_sensors_are_put_together_by_preset():
    assert gathered(RESULTS) == {Preset.BEST: [ONE, OTHER, OTHER], Preset.PAPER: [OTHER, ONE]}


def test_the_papers_distribution_has_its_mean_and_deviation():
    shares = paper_distribution() * WIDTHS
    assert 0.99 < shares.sum() < 1  # almost nothing lies above 5.5 mm
    mean = shares @ MIDDLES / shares.sum()
    assert mean == pytest.approx(PAPER_MEAN_MM, abs=0.05)
    assert np.sqrt(shares @ (MIDDLES - mean) ** 2 / shares.sum()) == pytest.approx(
        PAPER_SD_MM, abs=0.08)


def test_every_row_has_as_many_cells_as_there_are_headings():
    shown = {"ours": distribution([ONE]), "the paper's": paper_distribution()}
    for table in (points_table(RESULTS), error_table(RESULTS), distribution_table(shown),
                  quality_table(RESULTS, Preset.BEST)):
        heading, rule, *rows = table
        assert len({line.count("|") for line in (heading, rule, *rows)}) == 1


def test_table_1_has_points_and_their_ratio_beside_the_papers():
    *_, recording, sensor, paper = points_table(RESULTS)
    assert recording == "| a recording | 10 | 4 (0.4) | 4 (0.4) |"
    assert sensor == "| a sensor | 10 | 4 (0.4) | 4 (0.4) |"
    assert "8,352-13,267" in paper
    assert "79,482-132,476" in paper


def test_table_2_has_our_errors_and_all_four_rows_of_the_paper():
    _, _, recording, _, *paper = error_table(RESULTS)
    assert recording == "| a recording | 1.50 | 1.02 ± 0.98 | 2.96 ± 3.50 | |"
    assert [row.split("*")[-2] for row in paper] == [
        "1.61 ± 1.62", "3.58 ± 0.59", "3.12 ± 1.14", "1.31 ± 1.07"]
    assert all("other faces, sensors and references" in row for row in paper)


def test_figure_9_is_told_in_shares_per_mm_and_what_lies_beyond():
    _, _, first, *_, last = distribution_table({"ours": distribution([OTHER])})
    assert first == "| 0.0-0.5 | 0.00 |"
    rows = list(distribution_table({"ours": distribution([OTHER])}))
    assert rows[3] == "| 0.5-1.0 | 100.00 |"  # half of the points in half a millimetre
    assert last == "| > 5.5, % of all | 25.00 |"
