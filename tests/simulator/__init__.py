"""A Kinect v1 that is not there: frames of heads whose true shape is known."""

from tests.simulator.accuracy import Accuracy, measure
from tests.simulator.deformed import Deformed, Patch, Raised, patch
from tests.simulator.heads import Head, head_names, load_head, shared_folder
from tests.simulator.kinect import KINECT_CALIBRATED, KINECT_DEFAULT, KinectModel
from tests.simulator.labels import Label
from tests.simulator.scene import Light, Person, Scene
from tests.simulator.sensor import Simulated, simulate
from tests.simulator.true_colors import TrueColors
from tests.simulator.truth import Truth

__all__ = [
    "KINECT_CALIBRATED",
    "KINECT_DEFAULT",
    "Accuracy",
    "Deformed",
    "Head",
    "KinectModel",
    "Label",
    "Light",
    "Patch",
    "Person",
    "Raised",
    "Scene",
    "Simulated",
    "TrueColors",
    "Truth",
    "head_names",
    "load_head",
    "measure",
    "patch",
    "shared_folder",
    "simulate",
]
