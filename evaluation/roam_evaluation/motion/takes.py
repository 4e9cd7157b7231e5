"""Contact sheets of baked motions with their object: what `roam sit … -o motion.npz` did, frame by frame.

python -m roam_evaluation.motion.takes motion.npz chair.glb sheet.png
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from roam_character.clip import Clip
from roam_character.formats.npz import read_motion
from roam_character.skeleton import humanoid_skeleton
from roam_goalpose.objects import Shape, format_of, load_shape

from roam_evaluation.shared.picture import (
    Pixels,
    Splats,
    body_splats,
    cloud_splats,
    contact_sheet,
    object_splats,
    render,
)

VIEWS = {"side": np.pi / 2, "front": 0.0}
SPAN = 2.3  # [m] of the world in a picture


def main(argv: Sequence[str] | None = None) -> int:
    """Draws one motion. Returns the process exit code."""
    parser = argparse.ArgumentParser(description="contact sheet of a baked motion with its object")
    parser.add_argument("motion", type=Path, help=".npz written by roam sit")
    parser.add_argument("object", type=Path, help="the object it was made for")
    parser.add_argument("sheet", type=Path, help="PNG to write")
    parser.add_argument("--frames", type=int, default=12, help="how many moments to show")
    options = parser.parse_args(argv)
    clip = read_motion(options.motion, humanoid_skeleton())
    shape = load_shape(options.object.read_bytes(), format_of(options.object))
    options.sheet.parent.mkdir(parents=True, exist_ok=True)
    contact_sheet(draw(clip, shape, options.frames), columns=options.frames).save(options.sheet, optimize=True)
    return 0


def draw(clip: Clip, shape: Shape, count: int) -> list[tuple[str, Pixels]]:
    """One row per view, `count` moments each; side and front are those of the last pose."""
    scene = object_splats(*shape.mesh) if shape.mesh is not None else cloud_splats(shape.points, shape.normals)
    moments = np.linspace(0, len(clip) - 1, count).round().astype(int)
    yaw = clip.pose(len(clip) - 1).yaw()
    return [
        (f"{view}, {moment / clip.frame_rate:.1f} s", _picture(clip, scene, int(moment), yaw + turn))
        for view, turn in VIEWS.items()
        for moment in moments
    ]


def _picture(clip: Clip, scene: Splats, moment: int, azimuth: float) -> Pixels:
    pose = clip.pose(moment)
    center = pose.root_position.copy()
    center[1] = scene.points[:, 1].min() + SPAN * 0.38
    return render([scene, body_splats(pose)], azimuth=azimuth, elevation=0.08, size=190, span=SPAN, center=center)


if __name__ == "__main__":
    raise SystemExit(main())
