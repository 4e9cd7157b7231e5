"""`--character FILE`: the user's own character, mapped, measured, and posed."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from roam_client import GoalPose, Motion
from roam_client.types.skeleton import Skeleton, Tip

from roam_command.reports import UsageError, stderr

if TYPE_CHECKING:
    from roam_character.retargeting.onto_rig import RigMotion
    from roam_character.retargeting.proportions import Fit
    from roam_character.rigs.mapping import BoneMap
    from roam_character.skeleton import Skeleton as OwnSkeleton


@dataclass(frozen=True)
class CharacterChoice:
    """Whose body it is."""

    character: Annotated[
        Path | None,
        typer.Option(
            "--character", metavar="FILE", help="Your own character: vrm, glb, gltf, fbx, usd or bvh, any humanoid rig."
        ),
    ] = None
    map: Annotated[
        Path | None,
        typer.Option(
            "--map", metavar="FILE", help='Which joint is which bone where it is not told right: {"hips": "joint", …}.'
        ),
    ] = None

    def load(self, *, height: float | None = None) -> "Character | None":
        """The character, or None when none is asked for. UsageError when it cannot be used."""
        if self.character is None:
            if self.map is not None:
                raise UsageError("--map belongs to --character", remedy="Give the character's file too.")
            return None
        try:
            from roam_character.retargeting.proportions import fit
            from roam_character.rigs.mapping import map_bones, read_map
            from roam_character.rigs.reading import read_rig
            from roam_character.rigs.rig import RigError
        except ModuleNotFoundError as error:
            raise UsageError(
                f"--character needs the services, and {error.name} is not installed",
                remedy="Install them: scripts/install in a checkout.",
            ) from error
        try:
            rig = read_rig(self.character)
            bones = map_bones(rig, None if self.map is None else read_map(self.map))
            return Character(self.character, fit(rig, bones, height=height), bones)
        except RigError as error:
            raise UsageError(str(error), remedy=error.remedy) from error


@dataclass(frozen=True, eq=False)
class Character:
    """A character that poses are made for."""

    path: Path
    fit: "Fit"
    bones: "BoneMap"

    @property
    def skeleton(self) -> Skeleton:
        """Its proportions as the protocol's skeleton."""
        own = self.fit.skeleton
        return Skeleton(
            id=own.id,
            joint_names=own.joint_names,
            parents=own.parents,
            rest_offsets=own.rest_offsets,
            rest_rotations=own.rest_rotations,
            humanoid_bones=own.humanoid_bones,
            tips=tuple(Tip(tip.name, tip.parent, tip.offset) for tip in own.tips),
        )

    def posed(self, goal: GoalPose) -> "RigMotion":
        """A goal pose of its skeleton on its own joints."""
        from roam_character.pose import Pose
        from roam_character.retargeting.onto_rig import onto_rig

        return onto_rig(self.fit, Pose(self.fit.skeleton, goal.root_position, goal.rotations))

    def moved(self, motion: Motion) -> "RigMotion":
        """A motion of its skeleton on its own joints."""
        from roam_character.clip import Clip
        from roam_character.retargeting.onto_rig import onto_rig

        return onto_rig(self.fit, Clip(self.fit.skeleton, motion.frame_rate, motion.root_positions, motion.rotations))

    def performing(self, motion: Motion, goal: GoalPose) -> Motion:
        """A motion of the default figure (with its goal) on this body, ending in the body's own goal pose."""
        from roam_character.clip import Clip
        from roam_character.pose import Pose
        from roam_character.retargeting.onto_body import Performance, onto_body

        if motion.goal is None:
            raise ValueError("the motion has no goal")
        figure = own_skeleton(motion.skeleton)
        theirs = Clip(figure, motion.frame_rate, motion.root_positions, motion.rotations)
        going_to = Pose(figure, motion.goal.root_position, motion.goal.rotations)
        performance = Performance(theirs, motion.contacts, going_to, goal.floor_height)
        clip, contacts = onto_body(performance, Pose(self.fit.skeleton, goal.root_position, goal.rotations))
        return replace(
            motion,
            skeleton=self.skeleton,
            root_positions=clip.root_positions,
            rotations=clip.rotations,
            joint_positions=np.asarray(clip.positions(), np.float32),
            contacts=contacts,
            goal=goal,
        )

    def size_ratio(self, figure: Skeleton) -> float:
        """How much longer its legs are than the figure's."""
        from roam_character.retargeting.onto_body import size_ratio

        return size_ratio(self.fit.skeleton, own_skeleton(figure))

    def tell(self) -> None:
        """Says on stderr what was assumed about it and what looked odd."""
        for note in (*self.fit.notes, *self.bones.doubts):
            stderr.print(f"[yellow]character:[/] {note}".replace("[/]", "[/] ", 1), highlight=False)
        if self.bones.overall < 0.7:
            stderr.print(
                f"[yellow]character:[/]  the bones of {self.path.name} were told by their shape alone: look at the "
                "result, and correct it with --map FILE"
            )

    def figures(self) -> dict[str, Any]:
        """The numbers and names for machines."""
        return {
            "file": str(self.path),
            "family": self.bones.family,
            "confidence": self.bones.overall,
            "height": self.fit.height,
            "scale": self.fit.scale,
            "bones": self.bones.names(self.fit.rig),
            "notes": [*self.fit.notes, *self.bones.doubts],
        }

    def lines(self) -> list[tuple[str, str]]:
        """The same for people."""
        family = f"{self.bones.family}, " if self.bones.family else ""
        found = f"{len(self.bones.bones)} of 22 bones, sure {self.bones.overall:.2f}, {self.fit.height:.2f} m tall"
        return [("character", f"{self.path.name}: {family}{found}")]


def own_skeleton(skeleton: Skeleton) -> "OwnSkeleton":
    """A skeleton of the protocol as the services' own type."""
    from roam_character.skeleton import Skeleton as Own
    from roam_character.skeleton import Tip as OwnTip

    return Own(
        joint_names=skeleton.joint_names,
        parents=skeleton.parents,
        rest_offsets=skeleton.rest_offsets,
        rest_rotations=skeleton.rest_rotations,
        humanoid_bones=skeleton.humanoid_bones,
        tips=tuple(OwnTip(tip.name, tip.joint, tip.offset) for tip in skeleton.tips),
    )
