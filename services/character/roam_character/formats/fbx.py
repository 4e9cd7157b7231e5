"""FBX, written by Blender from our GLB: where a Blender is installed (`blender`, or a Python that has `bpy`).

Set for game engines: metres (FBX_SCALE_UNITS), no leaf bones, every frame keyed.
ROAM_BLENDER names a `blender` program or a Python with bpy; else both are looked for.
"""

import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from roam_character.formats import glb
from roam_character.formats.registry import ExportError, Format
from roam_character.formats.scene import Scene

_SECONDS = 300
_SCRIPT = """
import sys
import bpy
source, target, rate, last = sys.argv[-4:]
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
# Before the import: Blender puts keys at the frames of the scene's rate, and that is 24 a second.
scene.render.fps, scene.render.fps_base = round(float(rate)), round(float(rate)) / float(rate)
bpy.ops.import_scene.gltf(filepath=source, disable_bone_shape=True)
scene.frame_start, scene.frame_end = 0, int(last)
for item in list(bpy.data.objects):
    if item.name.startswith("Icosphere") and item.users_scene == ():
        bpy.data.objects.remove(item)
bpy.ops.export_scene.fbx(
    filepath=target, add_leaf_bones=False, apply_scale_options="FBX_SCALE_UNITS", bake_anim=int(last) > 0,
    bake_anim_use_all_actions=False, bake_anim_use_nla_strips=False, bake_anim_simplify_factor=0.0, path_mode="COPY",
    embed_textures=True,
)
"""


def blender_command() -> list[str]:
    """How to run a script in Blender: [] when there is none."""
    given = os.environ.get("ROAM_BLENDER", "")
    if given:
        return [given, "-b", "--factory-startup", "--python"] if "blender" in Path(given).name.lower() else [given]
    if importlib.util.find_spec("bpy") is not None:
        return [sys.executable]
    program = shutil.which("blender")
    return [program, "-b", "--factory-startup", "--python"] if program else []


def write(path: Path, scene: Scene) -> Sequence[str]:
    """Writes GLB, opens it in Blender and saves it as FBX. Raises ExportError when Blender fails."""
    with tempfile.TemporaryDirectory() as folder:
        source, script, target = (Path(folder) / name for name in ("scene.glb", "export.py", "scene.fbx"))
        notes = glb.write(source, scene)
        script.write_text(_SCRIPT)
        clip = scene.clip
        command = [*blender_command(), str(script), "--", str(source), str(target), str(clip.frame_rate)]
        environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
        done = subprocess.run(
            [*command, str(len(clip) - 1)],
            capture_output=True,
            text=True,
            timeout=_SECONDS,
            cwd=folder,
            env=environment,
        )
        if not target.is_file():
            reason = (done.stderr.strip() or done.stdout.strip()).splitlines()[-1:] or [f"status {done.returncode}"]
            raise ExportError(f"Blender could not write {path.name}: {reason[0]}", remedy="Write .glb instead.")
        shutil.copyfile(target, path)
    return notes


def _missing() -> str:
    return "" if blender_command() else "Blender (the program on PATH, or pip install bpy)"


FORMAT = Format(
    "fbx", "FBX (by Blender, where it is installed)", (".fbx",), write=write, furniture=True, missing=_missing
)
