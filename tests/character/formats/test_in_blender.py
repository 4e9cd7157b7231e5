"""Blender opens what is written: joints within a millimetre at every frame looked at, bones of the right length."""

import numpy as np
import pytest
from roam_character.formats import registry
from roam_character.formats.scene import Scene

_SCRIPT = """
import json, sys
import bpy
import numpy as np
path, rate = sys.argv[-2], float(sys.argv[-1])
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = int(rate)
if path.endswith("glb"):
    bpy.ops.import_scene.gltf(filepath=path, disable_bone_shape=True)
elif path.endswith("fbx"):
    bpy.ops.import_scene.fbx(filepath=path)
elif path.endswith("bvh"):
    bpy.ops.import_anim.bvh(filepath=path, global_scale=0.01, update_scene_fps=True)
else:
    bpy.ops.wm.usd_import(filepath=path)
figure = next(o for o in bpy.data.objects if o.type == "ARMATURE")
first, last = figure.animation_data.action.frame_range
places = {}
for key in range(0, 40, 6):
    scene.frame_set(int(first) + key)
    bpy.context.view_layer.update()
    for bone in figure.pose.bones:
        x, y, z = figure.matrix_world @ bone.head
        places.setdefault(bone.name, []).append([x, z, -y])
lengths = {bone.name: bone.length for bone in figure.data.bones}
print(json.dumps({"places": places, "lengths": lengths, "frames": last - first, "rate": scene.render.fps}))
"""


@pytest.mark.parametrize("ending", ["glb", "fbx", "bvh", "usdc"])
def test_joints_are_where_we_have_them(turning, blender, tmp_path, ending):
    if ending == "usdc":
        pytest.importorskip("pxr", reason="writing USD needs usd-core")
    path = tmp_path / f"turning.{ending}"
    if lacking := registry.format_of(path).missing():
        pytest.skip(f"writing {ending} needs {lacking}")
    registry.write(path, Scene(turning))
    found = blender(_SCRIPT, str(path), "30")
    wanted = turning.positions()[::6]
    for joint, name in enumerate(turning.skeleton.joint_names):
        np.testing.assert_allclose(found["places"][name], wanted[:, joint], atol=0.001, err_msg=name)
    if ending in ("glb", "fbx", "bvh"):
        assert found["lengths"]["leftHand"] == pytest.approx(0.16, abs=0.002)
        assert found["lengths"]["head"] == pytest.approx(0.19, abs=0.002)
