"""What captured people do in every activity, remembered: it changes with the clips and the measures alone."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from roam_evaluation.motion.people.activities import Activity, Sample
from roam_evaluation.motion.people.captured import Captured, fingerprint


def people_samples(
    activity: Activity, captured: Captured, root: Path, cache: Path
) -> tuple[list[Sample], list[Sample]]:
    """Samples of held-out and of training clips."""
    path = cache / f"samples-{_key(activity, root)}.json"
    if path.exists():
        held, kept = ([Sample(**row) for row in rows] for rows in json.loads(path.read_text()))
        return held, kept
    groups = activity.captured(captured.held_out), activity.captured(captured.training)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps([_rows(group) for group in groups]))
    return groups


def _rows(samples: Sequence[Sample]) -> list[dict[str, object]]:
    return [asdict(sample) for sample in samples]


def _key(activity: Activity, root: Path) -> str:
    """Of the clips, the activity, and all code of this package that measures."""
    key = hashlib.sha256(f"{activity.key} {fingerprint(root)}".encode())
    for source in sorted(Path(__file__).parent.rglob("*.py")):
        if source.stem in _MEASURING:
            key.update(source.read_bytes())
    return key.hexdigest()[:12]


_MEASURING = {
    "activities",
    "feet",
    "frames",
    "lying",
    "posture",
    "running",
    "sitting",
    "standing",
    "turning",
    "variety",
    "walking",
}
