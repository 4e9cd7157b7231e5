"""Puts what lies beside the packages in a checkout into the wheel: weights, reference poses, example furniture.

An editable installation stays as it is: there the files are found where they lie.
"""

from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

FILES = {
    "weights": "roam_serving/data/weights",
    "examples/references": "roam_serving/data/references",
    "examples/objects": "roam_serving/data/objects",
}


class WheelFiles(BuildHookInterface):
    """Hatchling calls it before it builds a wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Adds the folders; `version` is "standard" or "editable"."""
        if version == "standard":
            build_data["force_include"].update(FILES)
