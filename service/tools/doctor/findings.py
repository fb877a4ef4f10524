"""What the doctor found: `ok`, `warning` or `problem`, and what to do about it."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum

__all__ = ["Finding", "Level", "as_json", "as_lines"]


class Level(StrEnum):
    """How bad it is."""

    OK = "ok"
    WARNING = "warning"
    """It works, but not as well as it could."""
    PROBLEM = "problem"
    """A press will not become a good face."""


@dataclass(frozen=True)
class Finding:
    """One line of the doctor's."""

    level: Level
    what: str
    """What was looked at, in a word or two."""
    text: str
    remedy: str = ""
    """What to do about it; empty where all is well."""


def ok(what: str, text: str) -> Finding:
    """Say that all is well."""
    return Finding(Level.OK, what, text)


def warning(what: str, text: str, remedy: str) -> Finding:
    """Say what could be better."""
    return Finding(Level.WARNING, what, text, remedy)


def problem(what: str, text: str, remedy: str) -> Finding:
    """Say what is wrong."""
    return Finding(Level.PROBLEM, what, text, remedy)


def worst(findings: Sequence[Finding]) -> Level:
    """Give the worst level of all."""
    return max((finding.level for finding in findings), key=list(Level).index, default=Level.OK)


def as_lines(findings: Sequence[Finding]) -> list[str]:
    """Give a line for each finding, and one more for its remedy."""
    lines = []
    for finding in findings:
        lines.append(f"{finding.level:8} {finding.what}: {finding.text}")
        if finding.remedy:
            lines.append(f"{'':8} -> {finding.remedy}")
    return lines


def as_json(findings: Sequence[Finding]) -> str:
    """Give one JSON object: the worst level, and the findings."""
    return json.dumps({"level": worst(findings), "findings": [asdict(one) for one in findings]})
