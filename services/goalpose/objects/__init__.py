"""Object input: an uploaded file becomes a `Shape` in metres, +Y up, with surface samples and a distance grid."""

from goalpose.objects.distance import DistanceGrid
from goalpose.objects.errors import REASONS, ObjectError
from goalpose.objects.formats import FORMATS, format_of
from goalpose.objects.isolation import IsolatedLoader
from goalpose.objects.limits import Limits
from goalpose.objects.loading import load_shape
from goalpose.objects.shape import Shape, ShapeWarning

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
