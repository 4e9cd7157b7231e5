"""What is wrong with an upload, in words its sender can act on.

ValueError
└── ObjectError          every refusal of a file, with a reason from REASONS
"""

from __future__ import annotations

from collections.abc import Mapping

# reason -> title. The servers' error table adds status codes; nothing here knows about HTTP or gRPC.
REASONS: Mapping[str, str] = {
    "OBJECT_FORMAT_UNKNOWN": "The format name is not known",
    "OBJECT_FORMAT_UNSUPPORTED": "The format is known but not read here",
    "OBJECT_FORMAT_MISMATCH": "The content is not in the named format",
    "OBJECT_EXTERNAL_FILE": "The file refers to another file",
    "OBJECT_MALFORMED": "The file is damaged or not valid",
    "OBJECT_EMPTY": "The file holds no surface and no points",
    "OBJECT_TOO_LARGE": "The file has too many bytes",
    "OBJECT_TOO_COMPLEX": "The object has too many vertices or faces, or takes too long to read",
    "OBJECT_NOT_FINITE": "A coordinate is not a finite number",
    "OBJECT_TOO_FLAT": "The object has no volume to sit on",
    "OBJECT_TOO_FEW_POINTS": "The point cloud is too sparse",
    "OBJECT_FAR_AWAY": "The object lies too far from its own origin",
    "OBJECT_SIZE_IMPLAUSIBLE": "The object is not furniture-sized",
    "OBJECT_UNIT_UNKNOWN": "The unit is not known",
    "OBJECT_UP_UNKNOWN": "The up axis is not known",
    "OBJECT_PIECE_UNKNOWN": "The file has no such piece",
    "OBJECT_READER_FAILED": "The reader stopped unexpectedly",
}


class ObjectError(ValueError):
    """A file that cannot become a `Shape`.

    Attributes:
        reason: one of `REASONS`.
        field: the argument at fault: `content`, `format`, `unit`, `up`, `size` or `piece`.
        message: what was found, in one sentence.
        remedy: what the sender can do about it, in one sentence.
    """

    def __init__(self, reason: str, *, field: str, message: str, remedy: str) -> None:
        if reason not in REASONS:
            raise KeyError(reason)
        self.reason = reason
        self.field = field
        self.message = message
        self.remedy = remedy
        super().__init__(f"{message} {remedy}")

    def to_dict(self) -> dict[str, str]:
        """The four fields as plain strings; the inverse of `from_dict`."""
        return {"reason": self.reason, "field": self.field, "message": self.message, "remedy": self.remedy}

    @classmethod
    def from_dict(cls, fields: Mapping[str, str]) -> ObjectError:
        """Rebuild an error that crossed a process boundary."""
        return cls(fields["reason"], field=fields["field"], message=fields["message"], remedy=fields["remedy"])

    def __reduce__(self) -> tuple[object, tuple[dict[str, str]]]:
        return ObjectError.from_dict, (self.to_dict(),)


def not_finite(message: str) -> ObjectError:
    """Coordinates that nothing can be computed with."""
    return ObjectError(
        "OBJECT_NOT_FINITE",
        field="content",
        message=message,
        remedy="Remove those vertices (in Blender: Mesh > Clean Up) and export again.",
    )


def malformed(format: str, detail: str) -> ObjectError:
    """The content claims to be `format` but cannot be read as such."""
    return ObjectError(
        "OBJECT_MALFORMED",
        field="content",
        message=f"The content cannot be read as {format.upper()}: {detail.rstrip('.')}.",
        remedy="Open it in a 3D program, check that it looks right, and export it again; GLB is the safest choice.",
    )


def out_of_memory() -> ObjectError:
    """For a file whose reading needs more than a reader may use."""
    return ObjectError(
        "OBJECT_TOO_COMPLEX",
        field="content",
        message="Reading the file takes more memory than a reader may use.",
        remedy="Simplify the mesh (in Blender: the Decimate modifier); 20,000 triangles are plenty.",
    )
