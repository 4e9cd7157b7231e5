"""Contact sheets of judged goal poses: one picture of every object, drawn from the records."""

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from roam_character.pose import Pose
from roam_goalpose.objects import Shape, load_shape

from roam_evaluation.goalpose.inputs.objects import EvaluationObject
from roam_evaluation.goalpose.runs import run_from
from roam_evaluation.shared.ledger import Record
from roam_evaluation.shared.picture import (
    Pixels,
    body_splats,
    cloud_splats,
    contact_sheet,
    mark_deep,
    object_splats,
    scene_views,
)


class Judged(Protocol):
    """A pose with a line that says how good it is."""

    @property
    def pose(self) -> Pose:
        """On the canonical object."""
        ...

    def line(self) -> str:
        """For the terminal."""
        ...


def write_sheets(
    path: Path,
    objects: list[EvaluationObject],
    records: list[Record],
    *,
    per_sheet: int = 24,
    read: Callable[[Record], Judged] = run_from,
) -> None:
    """The first run of every object, `per_sheet` to a picture; `read` makes runs of records."""
    first = {record["object"]: read(record) for record in reversed(records)}
    cells = []
    for item in objects:
        if item.name in first:
            run = first[item.name]
            picture = draw(load_shape(item.read(), item.format), run.pose)
            cells.append((f"{item.name[:44]}  {run.line()}", picture))
    for start in range(0, len(cells), per_sheet):
        name = path if len(cells) <= per_sheet else path.with_stem(f"{path.stem}-{start // per_sheet + 1}")
        name.parent.mkdir(parents=True, exist_ok=True)
        contact_sheet(cells[start : start + per_sheet], columns=2).save(name)


def draw(shape: Shape, pose: Pose) -> Pixels:
    """Three views of the object with the body; what lies deep in the object is red."""
    scene = object_splats(*shape.mesh) if shape.mesh is not None else cloud_splats(shape.points, shape.normals)
    body = body_splats(pose)
    return scene_views([scene, mark_deep(body, shape.distance.sample(body.points))])
