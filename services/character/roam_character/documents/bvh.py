"""BVH motion files: the reader keeps the file's own skeleton, the writer writes any clip.

Lengths in the file are scaled to metres (most files are in centimetres: `unit` guesses from the figure's size unless
given). Rotation channels may come in any order, R = product of the channels as listed.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from roam_character.clip import Clip
from roam_character.documents.euler import euler_rows
from roam_character.rotation import quat_from_rotvec, quat_mul
from roam_character.skeleton import Skeleton, Tip

_AXES = {"X": np.array([1.0, 0, 0]), "Y": np.array([0, 1.0, 0]), "Z": np.array([0, 0, 1.0])}


class BvhError(ValueError):
    """The file is not a BVH file that can be read; the message says where and why."""


@dataclass
class _Hierarchy:
    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    offsets: list[list[float]] = field(default_factory=list)
    channels: list[list[str]] = field(default_factory=list)
    tips: list[tuple[str, int, list[float]]] = field(default_factory=list)


def read_bvh(path: str | Path, *, unit: float | None = None) -> Clip:
    """A clip on the file's own skeleton.

    `unit` is the length of one file unit [m]; by default 0.01 when the figure is taller than 10 units, else 1.
    Raises BvhError with the file's name and the reason.
    """
    path = Path(path)
    try:
        head, _, motion = path.read_text(errors="replace").partition("MOTION")
        hierarchy = _parse_hierarchy(iter(head.split()))
        interval, values = _parse_motion(motion, sum(map(len, hierarchy.channels)))
        roots, rotations = _decode(hierarchy, values)
    except (BvhError, StopIteration, ValueError, IndexError) as error:
        raise BvhError(f"{path.name}: {error or 'the hierarchy ends too early'}") from error
    scale = unit or _guess_unit(hierarchy)
    skeleton = Skeleton(
        joint_names=tuple(hierarchy.names),
        parents=tuple(hierarchy.parents),
        rest_offsets=np.array(hierarchy.offsets, np.float32) * np.float32(scale),
        rest_rotations=np.tile(np.array([0, 0, 0, 1], np.float32), (len(hierarchy.names), 1)),
        tips=tuple(Tip(n, p, (o[0] * scale, o[1] * scale, o[2] * scale)) for n, p, o in hierarchy.tips),
        name=path.stem,
    )
    # Files round the frame time: 0.04166667 s means 24 Hz.
    return Clip(skeleton, round(1.0 / interval, 3), (roots * scale).astype(np.float32), rotations.astype(np.float32))


def _parse_hierarchy(tokens: Iterator[str]) -> _Hierarchy:
    if next(tokens) != "HIERARCHY":
        raise BvhError("does not begin with HIERARCHY")
    tree, stack, tip = _Hierarchy(), list[int](), False
    for token in tokens:
        if token in ("ROOT", "JOINT"):
            tree.names.append(next(tokens))
            tree.parents.append(stack[-1] if stack else -1)
            tree.offsets.append([0.0, 0.0, 0.0])
            tree.channels.append([])
        elif token == "End":
            next(tokens)
            tip = True
            tree.tips.append((tree.names[stack[-1]] + "Tip", stack[-1], [0.0, 0.0, 0.0]))
        elif token == "{":
            stack.append(stack[-1] if tip else len(tree.names) - 1)
        elif token == "}":
            stack.pop()
            tip = False
        elif token == "OFFSET":
            (tree.tips[-1][2] if tip else tree.offsets[stack[-1]])[:] = [float(next(tokens)) for _ in range(3)]
        elif token == "CHANNELS":
            tree.channels[stack[-1]] = [next(tokens) for _ in range(int(next(tokens)))]
        else:
            raise BvhError(f"unexpected {token!r} in the hierarchy")
    if not tree.names:
        raise BvhError("has no joints")
    return tree


def _parse_motion(text: str, width: int) -> tuple[float, np.ndarray]:
    lines = [line for line in text.splitlines() if line.strip()]
    if len(lines) < 3 or "Frames" not in lines[0] or "Frame Time" not in lines[1]:
        raise BvhError("has no MOTION part with Frames and Frame Time")
    interval = float(lines[1].split()[-1])
    if interval <= 0:
        raise BvhError(f"Frame Time is {interval}, not a positive number of seconds")
    values = np.array(" ".join(lines[2:]).split(), dtype=float)
    if values.size == 0 or values.size % width:
        raise BvhError(f"{values.size} motion values are not a multiple of {width} channels")
    return interval, values.reshape(-1, width)


def _guess_unit(tree: _Hierarchy) -> float:
    reach = float(np.abs(np.array(tree.offsets[1:])).sum(axis=1).max()) if len(tree.offsets) > 1 else 0.0
    return 0.01 if reach > 3.0 else 1.0


def _decode(tree: _Hierarchy, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    count, column = len(values), 0
    roots = np.tile(np.array(tree.offsets[0]), (count, 1))
    rotations = np.zeros((count, len(tree.names), 4))
    rotations[..., 3] = 1
    for joint, channels in enumerate(tree.channels):
        for channel in channels:
            axis, kind = channel[0].upper(), channel[1:].lower()
            if axis not in _AXES or kind not in ("position", "rotation"):
                raise BvhError(f"channel {channel!r} is neither a position nor a rotation")
            if kind == "rotation":
                turn = quat_from_rotvec(np.radians(values[:, column, None]) * _AXES[axis])
                rotations[:, joint] = quat_mul(rotations[:, joint], turn)
            elif joint == 0:
                roots[:, "XYZ".index(axis)] = values[:, column]
            column += 1
    return roots, rotations


def write_bvh(path: str | Path, clip: Clip) -> None:
    """Writes a clip in centimetres and degrees.

    The root has OFFSET 0 and six channels, every other joint three rotations (Zrotation Xrotation Yrotation, or the
    order of axes in which its rows are calmest). Rows are continuous, so that readers may interpolate channels.
    """
    skeleton = clip.skeleton
    order = _written_order(skeleton)
    turns = [euler_rows(clip.rotations[:, joint]) for joint in range(skeleton.joint_count)]
    axes = [channels for _, channels in turns]
    lines = ["HIERARCHY", *_hierarchy_lines(skeleton, axes, 0, 0), "MOTION", f"Frames: {len(clip)}"]
    lines.append(f"Frame Time: {1 / clip.frame_rate:.8f}")
    table = np.concatenate([clip.root_positions * 100, *(np.degrees(turns[joint][0]) for joint in order)], axis=1)
    lines += [" ".join(f"{value:.6f}" for value in row) for row in table]
    Path(path).write_text("\n".join(lines) + "\n")


def _written_order(skeleton: Skeleton, joint: int = 0) -> list[int]:
    """Joints in the depth-first order of the file."""
    children = [c for c, p in enumerate(skeleton.parents) if p == joint]
    return [joint] + [j for child in children for j in _written_order(skeleton, child)]


def _hierarchy_lines(skeleton: Skeleton, axes: list[str], joint: int, depth: int) -> list[str]:
    pad = "  " * depth
    positions = "Xposition Yposition Zposition " if joint == 0 else ""
    rotations = " ".join(f"{axis}rotation" for axis in axes[joint])
    offset = np.zeros(3) if joint == 0 else skeleton.rest_offsets[joint] * 100
    lines = [f"{pad}{'JOINT' if joint else 'ROOT'} {_word(skeleton.joint_names[joint])}", pad + "{"]
    lines.append(f"{pad}  OFFSET {offset[0]:.6f} {offset[1]:.6f} {offset[2]:.6f}")
    lines.append(f"{pad}  CHANNELS {6 if joint == 0 else 3} {positions}{rotations}")
    children = [c for c, p in enumerate(skeleton.parents) if p == joint]
    for child in children:
        lines += _hierarchy_lines(skeleton, axes, child, depth + 1)
    if not children:
        tip = next((t.offset for t in skeleton.tips if t.parent == joint), (0.0, 0.0, 0.05))
        end = " ".join(f"{100 * value:.6f}" for value in tip)
        lines += [f"{pad}  End Site", pad + "  {", f"{pad}    OFFSET {end}", pad + "  }"]
    return [*lines, pad + "}"]


def _word(name: str) -> str:
    """A joint name as one word: BVH ends a name at the first space."""
    return "_".join(name.split()) or "joint"
