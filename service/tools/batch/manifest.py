"""What a batch's folder is of: how its faces are made, and what each input is called."""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from denseface.files import make_folder, read_bounded
from denseface.service.errors import FormatError, StoreError, UsageError, reason_of
from denseface.service.runtime.files import check_outside_hub, write_atomically
from denseface.service.tools.batch.inputs import input_names
from denseface.service.tools.batch.plan import Plan
from denseface.service.tools.batch.worker.records import FACES

__all__ = ["MANIFEST", "claim_folder"]

MANIFEST = "batch.json"
_MAX_BYTES = 1 << 28
"""Of a manifest: a shell gives no command more names than this has room for."""


def claim_folder(folder: Path, plan: Plan, inputs: Sequence[str]) -> dict[str, str]:
    """Make a folder for faces that are made so, or go on with one; give the inputs by their names.

    Parameters
    ----------
    folder : absolute

    Returns
    -------
    Absolute path -> name of its folder, or of its face, below the folder of faces

    Raises
    ------
    UsageError
        The folder has other things in it, or faces that were made otherwise; or it is among the
        inputs, or an input is none.
    FormatError, StoreError
        The manifest is damaged; the folder cannot be written. Also as `FaceFiles`.
    """
    check_outside_hub(folder / MANIFEST)
    asked = json.loads(plan.to_json())
    manifest = folder / MANIFEST
    there = _read(manifest)
    if there is None:
        _check_empty(folder)
        there = {"plan": asked, "inputs": {}}
    if differs := Plan.difference(there["plan"], asked):
        raise UsageError(f"{folder}: its faces were made otherwise: {differs}: name another "
                         "folder, or say the same as before")
    names = input_names(inputs, there["inputs"])
    for path in names:
        if Path(path) == folder or folder in Path(path).parents:
            raise UsageError(f"{path}: is where faces are written: name another folder")
    plan.files(folder / FACES / "x")
    if names != there["inputs"] or not manifest.exists():
        text = json.dumps({"plan": asked, "inputs": names}, indent=1)
        try:
            make_folder(folder)
            write_atomically(manifest, [text.encode()])
        except OSError as error:
            raise StoreError(f"{manifest}: {reason_of(error)}") from error
    return names


def _read(manifest: Path) -> dict[str, Any] | None:
    try:
        given = json.loads(read_bounded(manifest, _MAX_BYTES))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise StoreError(f"{manifest}: {reason_of(error)}") from error
    except ValueError:
        given = None
    whole = (isinstance(given, dict) and isinstance(given.get("plan"), dict)
             and isinstance(given.get("inputs"), dict)
             and all(isinstance(name, str) and _is_below(name)
                     for name in given["inputs"].values()))
    if not whole:
        raise FormatError(f"{manifest}: is no manifest of a batch, or damaged")
    return dict(given)


def _is_below(name: str) -> bool:
    return bool(name) and name not in (".", "..") and os.sep not in name


def _check_empty(folder: Path) -> None:
    try:
        if folder.exists() and any(folder.iterdir()):
            raise UsageError(f"{folder}: has files in it and no {MANIFEST}: name a new folder")
    except OSError as error:
        raise StoreError(f"{folder}: {reason_of(error)}") from error
