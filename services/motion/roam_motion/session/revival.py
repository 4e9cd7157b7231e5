"""A session made again from what the store has of it."""

from collections.abc import Callable

from roam.v1 import motion_pb2

from roam_motion.api.messages import control_change
from roam_motion.session.session import ControlChange, Session
from roam_motion.session.store.base import Claim, Snapshot


def revive(
    claim: Claim, after_sequence: int, *, build: str, reach: int, make: Callable[[Snapshot], Session]
) -> Session:
    """A claimed session, ready to compute what follows `after_sequence` (0: the newest that is known).

    `make` gives a session in a snapshot's state; `reach` is how far a replica may go beyond a snapshot. Frames are only
    promised to be exact where the same `build` made them.
    """
    snapshot = _fitting(claim, after_sequence)
    session = make(snapshot)
    later = [(entry, _change(entry.control, session)) for entry in claim.controls]
    last = claim.snapshots[-1]
    shown = max(last.shown, last.sequence + (0 if claim.released else reach))
    session.restore(snapshot, _change(snapshot.control, session), later, newest=last.sequence, shown=shown)
    session.exact = snapshot.build == build
    return session


def _fitting(claim: Claim, after_sequence: int) -> Snapshot:
    oldest, newest = claim.snapshots[0], claim.snapshots[-1]
    if not after_sequence:
        return newest
    return max(
        (snapshot for snapshot in claim.snapshots if snapshot.sequence <= after_sequence),
        key=lambda snapshot: snapshot.sequence,
        default=oldest,
    )


def _change(control: bytes, session: Session) -> ControlChange:
    return control_change(motion_pb2.ControlInput.FromString(control), session) if control else ControlChange()
