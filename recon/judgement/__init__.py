"""The last stage: whether depth is fine enough for a face, and what was made of it is one."""

from denseface.recon.judgement._colors import LEAST_COLOR_LIKENESS, color_likeness
from denseface.recon.judgement._judge import (
    LEAST_SCORE,
    SURE_SCORE,
    Judgement,
    judge_points,
    judge_shape,
    score_quickly,
)
from denseface.recon.judgement._likeness import Likeness
from denseface.recon.judgement._size_and_steps import check_face, check_steps

__all__ = ["LEAST_COLOR_LIKENESS", "LEAST_SCORE", "SURE_SCORE", "Judgement", "Likeness",
           "check_face", "check_steps", "color_likeness", "judge_points", "judge_shape",
           "score_quickly"]
