"""Which heads settings are chosen on, and which others figures are of."""

from tests.simulator import head_names

__all__ = ["CHOOSING", "REPORTING", "at_hand"]

CHOOSING = ("ict_id1", "ict_id2", "mh_asian_f")
"""Heads that settings are chosen and coefficients fitted on."""
REPORTING = ("lps", "ict_neutral", "mh_afr_f", "mh_cauc_m")
"""Heads that no setting was chosen on: every table is of these."""


def at_hand(heads: tuple[str, ...]) -> list[str]:
    """List those whose scans are at hand; the procedural head where none is."""
    return [name for name in heads if name in head_names()] or ["procedural"]
