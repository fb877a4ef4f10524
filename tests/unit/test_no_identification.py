"""No templates, no matching, no identification: what a face could be recognised by is not used."""

import re
import tomllib
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parents[2]
_MODULES = sorted(path for top in ("capture", "recon", "service")
                  for path in (_ROOT / top).rglob("*.py") if "node_modules" not in path.parts)
_OF_RECOGNITION = re.compile(
    r"FaceRecogni[sz]er|LBPH|EigenFace|FisherFace|matchTemplate|\bdnn\b|readNet|embedding"
    r"|faceprint|biometric", re.IGNORECASE)
"""Of OpenCV what recognises or matches, and the words for what is kept to recognise by."""


def _recognising(code: str) -> list[str]:
    return _OF_RECOGNITION.findall(code)


def test_nothing_of_opencv_that_recognises_or_matches_is_used():
    assert len(_MODULES) > 200
    found = {str(path.relative_to(_ROOT)): names for path in _MODULES
             if (names := _recognising(path.read_text()))}
    assert not found


@pytest.mark.parametrize("code", [
    "import cv2\ncv2.FaceRecognizerSF.create('a', 'b')", "cv2.face.LBPHFaceRecognizer_create()",
    "from cv2 import dnn", "def embedding_of(face): ...", "cv2.matchTemplate(a, b, 1)"])
def test_it_would_be_seen(code):
    assert _recognising(code)


def test_no_library_for_it_is_installed_with_denseface():
    project = tomllib.loads((_ROOT / "pyproject.toml").read_text())
    contract, = (one for one in project["tool"]["importlinter"]["contracts"]
                 if "recognises faces" in one["name"])
    locked = {line.partition("==")[0] for line in
              (_ROOT / "requirements/run.txt").read_text().splitlines() if "==" in line}
    assert len(locked) > 20
    assert not {name.replace("-", "_") for name in locked} & {
        *contract["forbidden_modules"], "opencv_contrib_python", "scikit_learn"}
    assert {"denseface"} <= set(contract["source_modules"])
