"""Object input: an uploaded file becomes a `Shape` in metres, +Y up, with surface samples and a distance grid."""

from roam_character.distance import DistanceGrid

from roam_goalpose.objects.errors import REASONS, ObjectError
from roam_goalpose.objects.isolation import IsolatedLoader
from roam_goalpose.objects.limits import Limits
from roam_goalpose.objects.loading import load_shape
from roam_goalpose.objects.readers.registry import FORMATS, format_of
from roam_goalpose.objects.shape import Shape, ShapeWarning

__all__ = [
    "FORMATS",
    "REASONS",
    "DistanceGrid",
    "IsolatedLoader",
    "Limits",
    "ObjectError",
    "Shape",
    "ShapeWarning",
    "format_of",
    "load_shape",
]
