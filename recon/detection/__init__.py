"""Stage 2: the face in the colour image, by Haar cascades, confirmed by its depth."""

from denseface.recon.detection._by_depth import detect_by_depth
from denseface.recon.detection._detect import (
    FACE_WIDTH_MM,
    REJECTED,
    Detection,
    detect_face,
    judge_box,
)
from denseface.recon.detection._follow import (
    Followed,
    Looked,
    close_face,
    follow_face,
    look_for_faces,
    turned_by,
)

__all__ = ["FACE_WIDTH_MM", "REJECTED", "Detection", "Followed", "Looked", "close_face",
           "detect_by_depth", "detect_face", "follow_face", "judge_box", "look_for_faces",
           "turned_by"]
