"""Stage 2: the face in the colour image, by Haar cascades, confirmed by its depth."""

from denseface.recon.detection._detect import FACE_WIDTH_MM, Detection, detect_face, judge_box

__all__ = ["FACE_WIDTH_MM", "Detection", "detect_face", "judge_box"]
