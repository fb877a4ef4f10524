"""Frames made of image files: a depth image and a colour image, or a folder of such pairs."""

from denseface.capture.image_pair._files import (
    read_color_image,
    read_depth_image,
    read_grey_image,
)
from denseface.capture.image_pair._folder import FolderSource
from denseface.capture.image_pair._pair import ImagePairSource, PairReading
from denseface.capture.image_pair._units import parse_unit

__all__ = ["FolderSource", "ImagePairSource", "PairReading", "parse_unit", "read_color_image",
           "read_depth_image", "read_grey_image"]
