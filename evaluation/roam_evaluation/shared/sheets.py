"""Contact sheets: a motion as a row of stick figures, side and front view, to be looked at."""

from pathlib import Path

import numpy as np

_LEFT, _RIGHT, _MIDDLE = "#c8443c", "#3463c4", "#222222"


def contact_sheet(
    path: Path,
    motions: dict[str, np.ndarray],
    parents: tuple[int, ...],
    names: tuple[str, ...],
    *,
    goals: dict[str, np.ndarray] | None = None,
    columns: int = 12,
    first: int = 0,
    last: int | None = None,
) -> None:
    """Draws motions [T, J, 3] as rows of `columns` poses; goal poses [J, 3] in grey. Writes a PNG to `path`.

    Each column shows the pose from the side (along world X) and from the front (along world Z), at its true height and
    place relative to the row's last frame.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    rows = 2 * len(motions)
    figure, axes = plt.subplots(rows, columns, figsize=(1.35 * columns, 1.6 * rows), squeeze=False)
    for number, (title, motion) in enumerate(motions.items()):
        frames = np.linspace(first, min(last or len(motion), len(motion)) - 1, columns).astype(int)
        goal = (goals or {}).get(title)
        for column, frame in enumerate(frames):
            for view in range(2):
                axis = axes[2 * number + view][column]
                _draw(axis, motion[frame], parents, names, view, goal)
                if view == 0:
                    axis.set_title(f"{title if column == 0 else ''} {frame}", fontsize=6, pad=1)
    figure.tight_layout(pad=0.2)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def _draw(
    axis: "object",
    pose: np.ndarray,
    parents: tuple[int, ...],
    names: tuple[str, ...],
    view: int,
    goal: np.ndarray | None,
) -> None:
    plot = axis.plot  # type: ignore[attr-defined]
    across = 2 if view == 0 else 0
    centre = pose[0, across]
    for shape, ghost in ((goal, True), (pose, False)):
        if shape is None:
            continue
        for joint, parent in enumerate(parents):
            if parent < 0:
                continue
            colour = (
                _LEFT if names[joint].startswith("left") else _RIGHT if names[joint].startswith("right") else _MIDDLE
            )
            line = shape[[parent, joint]]
            plot(line[:, across] - centre, line[:, 1], color="#bbbbbb" if ghost else colour, lw=0.8 if ghost else 1.3)
    plot([-0.8, 0.8], [0, 0], color="#888888", lw=0.5)
    axis.set_xlim(-0.8, 0.8)  # type: ignore[attr-defined]
    axis.set_ylim(-0.1, 1.8)  # type: ignore[attr-defined]
    axis.set_aspect("equal")  # type: ignore[attr-defined]
    axis.axis("off")  # type: ignore[attr-defined]


def top_view(
    path: Path, roots: dict[str, np.ndarray], directions: dict[str, np.ndarray], goals: dict[str, np.ndarray]
) -> None:
    """Draws root paths [T, 2] (x, z) with headings [T, 2] and goal roots [4] (x, z, direction) seen from above."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    count = len(roots)
    figure, axes = plt.subplots(1, count, figsize=(2.6 * count, 2.8), squeeze=False)
    for axis, (title, track) in zip(axes[0], roots.items(), strict=True):
        axis.plot(track[:, 0], track[:, 1], lw=1)
        axis.quiver(*track[::15].T, *directions[title][::15].T, width=0.008, scale=12)
        if title in goals:
            goal = goals[title]
            axis.plot(goal[0], goal[1], "rs")
            axis.quiver(goal[0], goal[1], goal[2], goal[3], color="r", scale=8)
        axis.set_aspect("equal")
        axis.set_title(title, fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    plt.close(figure)
