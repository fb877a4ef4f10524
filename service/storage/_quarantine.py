"""The folder of damaged files, with a report beside each."""

import json
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path

import structlog

from denseface.files import read_bounded
from denseface.service.runtime.files import sync_folder, write_atomically
from denseface.service.storage._folder_layout import is_quarantined
from denseface.service.storage._store_clock import StoreClock

_MAX_REPORT_BYTES = 2**16
"""Of a file's report."""


class Quarantine:
    """The folder `quarantine/`: `TIME.NAME` and its report, `TIME.NAME.json`.

    A damaged frame is still a picture of someone: it is removed with its capture, or after the
    retention.
    """

    def __init__(self, folder: Path, clock: StoreClock) -> None:
        self._folder = folder
        self._clock = clock
        self._captures: dict[str, str] = {}
        """Name of a report that was read -> the capture that it names, "" for none."""
        self._log = structlog.get_logger("store")

    def add(self, path: Path, reason: str, capture_id: str | None = None) -> None:
        """Move a file here; where it is gone or cannot be moved, only log it."""
        self._log.error("damaged", file=path.name, capture_id=capture_id, reason=reason)
        if not path.exists():
            return
        moment = self._clock.timestamp().replace(":", "")
        moved = self._folder / f"{moment}.{path.name}"
        report = moved.with_name(f"{moved.name}.json")
        try:
            write_atomically(report, [json.dumps({
                "file": str(path), "capture_id": capture_id, "reason": reason, "found": moment,
                "age_s": self._clock.now()}, indent=2).encode()])
            path.replace(moved)
        except OSError as error:
            with suppress(OSError):
                report.unlink(missing_ok=True)
            self._log.warning("not quarantined", file=path.name, reason=str(error))
        else:
            self._log.warning("quarantined", file=path.name, moved_to=str(moved))

    def remove(self, capture_ids: Collection[str]) -> None:
        """Remove the files of captures; OSError where one cannot be removed."""
        # Each report is read once: a purge of all comes here for every few hundred captures.
        known = self._captures
        self._captures = {
            report.name: known[report.name] if report.name in known else _capture_of(report)
            for report in self._reports()}
        removed = [name for name, one in self._captures.items() if one in capture_ids]
        for name in removed:
            _remove(self._folder / name)
        if removed:
            sync_folder(self._folder)

    def remove_before(self, age_s: float) -> None:
        """Remove files that came when the store was younger; OSError as `remove`."""
        for report in self._reports():
            if _age_s(report) <= age_s:
                _remove(report)

    def clear(self) -> None:
        """Remove all files that a hub put here; OSError as `remove`."""
        for path in list(self._folder.iterdir()):
            if is_quarantined(path):
                path.unlink(missing_ok=True)

    def _reports(self) -> list[Path]:
        return [path for path in self._folder.glob("*.json") if is_quarantined(path)]


def _read(report: Path) -> dict[str, object]:
    try:
        found = json.loads(read_bounded(report, _MAX_REPORT_BYTES))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _capture_of(report: Path) -> str:
    return str(_read(report).get("capture_id") or "")


def _age_s(report: Path) -> float:
    """Give the age of the store when a file came here, seconds; 0, the oldest, if unknown."""
    found = _read(report).get("age_s")
    return float(found) if isinstance(found, int | float) else 0.0


def _remove(report: Path) -> None:
    report.with_suffix("").unlink(missing_ok=True)
    report.unlink(missing_ok=True)
