"""Object input: an uploaded file becomes a `Shape` in metres, +Y up, with surface samples and a distance grid.

What reads files is imported when it is first asked for: a server reads them in a child process.
"""

from typing import TYPE_CHECKING, Any

from roam_character.distance import DistanceGrid

from roam_goalpose.objects.errors import REASONS, ObjectError
from roam_goalpose.objects.isolation import IsolatedLoader
from roam_goalpose.objects.limits import Limits
from roam_goalpose.objects.readers.registry import FORMATS, format_of
from roam_goalpose.objects.shape import Shape, ShapeWarning

if TYPE_CHECKING:
    from roam_goalpose.objects.loading import load_shape

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


def __getattr__(name: str) -> Any:
    if name != "load_shape":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from roam_goalpose.objects.loading import load_shape

    return load_shape
