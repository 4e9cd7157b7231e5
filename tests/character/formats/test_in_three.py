"""three.js plays what is written: a VRMA on a VRM of our own making, a BVH, both with joints where we have them."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "rigs"))

from rig_maker import BASE, character
from roam_character.clip import Clip
from roam_character.formats import registry
from roam_character.formats.scene import Scene
from roam_character.retargeting.onto_rig import onto_rig
from roam_character.retargeting.proportions import fit
from roam_character.rigs.mapping import map_bones
from roam_character.rigs.reading import read_rig

_VRMA = """
import fs from "node:fs";
import * as THREE from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { VRMLoaderPlugin } from "@pixiv/three-vrm";
import { VRMAnimationLoaderPlugin, createVRMAnimationClip } from "@pixiv/three-vrm-animation";
globalThis.self = globalThis;
const read = path => { const b = fs.readFileSync(path); return b.buffer.slice(b.byteOffset, b.byteOffset + b.length); };
const load = (path, plugin) => new Promise((done, failed) => {
  const loader = new GLTFLoader();
  loader.register(plugin);
  loader.parse(read(path), "", done, failed);
});
const vrm = (await load(process.argv[2], parser => new VRMLoaderPlugin(parser))).userData.vrm;
const animation = (await load(process.argv[3], p => new VRMAnimationLoaderPlugin(p))).userData.vrmAnimations[0];
const clip = createVRMAnimationClip(animation, vrm);
const mixer = new THREE.AnimationMixer(vrm.scene);
mixer.clipAction(clip).play();
const places = {};
for (const frame of [0, 9, 17, 30]) {
  mixer.setTime(frame / 30);
  vrm.humanoid.update();
  vrm.scene.updateMatrixWorld(true);
  for (const bone of Object.keys(vrm.humanoid.humanBones)) {
    const at = new THREE.Vector3();
    vrm.humanoid.getRawBoneNode(bone).getWorldPosition(at);
    (places[bone] ??= []).push(at.toArray());
  }
}
console.log(JSON.stringify(places));
"""

_BVH = """
import fs from "node:fs";
import * as THREE from "three";
import { BVHLoader } from "three/examples/jsm/loaders/BVHLoader.js";
const { clip, skeleton } = new BVHLoader().parse(fs.readFileSync(process.argv[2], "utf8"));
const root = skeleton.bones[0];
const mixer = new THREE.AnimationMixer(root);
mixer.clipAction(clip).play();
const places = {};
for (const frame of [0, 9, 9.5, 17, 30]) {
  mixer.setTime(frame * clip.tracks[0].times[1]);
  root.updateMatrixWorld(true);
  for (const bone of skeleton.bones) {
    const at = new THREE.Vector3();
    bone.getWorldPosition(at);
    (places[bone.name] ??= []).push(at.toArray());
  }
}
console.log(JSON.stringify(places));
"""


def module(folder: Path, script: str, *arguments: str, needs: str) -> Any:
    """Runs an ES module beside the npm packages of ROAM_TEST_NODE_MODULES; its last line of output as JSON."""
    packages, program = os.environ.get("ROAM_TEST_NODE_MODULES", ""), shutil.which("node")
    if program is None:
        pytest.skip("node is not installed")
    if not packages or not (Path(packages) / needs).is_dir():
        pytest.skip(f"npm package {needs} is not in ROAM_TEST_NODE_MODULES")
    (folder / "node_modules").symlink_to(packages)
    (folder / "script.mjs").write_text(script)
    done = subprocess.run(
        [program, str(folder / "script.mjs"), *arguments], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.strip().splitlines()[-1])


def test_vrma_moves_a_vrm(turning, tmp_path):
    document = character(arms_down=35)
    bones = {bone: {"node": index + 1} for index, bone in enumerate(BASE.joint_names)}
    meta = {"name": "test", "version": "1", "authors": ["test"], "licenseUrl": "https://vrm.dev/licenses/1.0/"}
    document.json["extensions"] = {"VRMC_vrm": {"specVersion": "1.0", "meta": meta, "humanoid": {"humanBones": bones}}}
    document.json["extensionsUsed"] = ["VRMC_vrm"]
    straight = character()  # VRM 1.0 asks for a T-pose in the nodes
    straight.json["extensions"], straight.json["extensionsUsed"] = document.json["extensions"], ["VRMC_vrm"]
    (tmp_path / "hero.vrm").write_bytes(straight.to_bytes())
    rig = read_rig(tmp_path / "hero.vrm")
    own = fit(rig, map_bones(rig))
    clip = Clip(own.skeleton, 30.0, turning.root_positions, turning.rotations)
    registry.write(tmp_path / "move.vrma", Scene(clip, character=onto_rig(own, clip)))
    found = module(
        tmp_path, _VRMA, str(tmp_path / "hero.vrm"), str(tmp_path / "move.vrma"), needs="@pixiv/three-vrm-animation"
    )
    wanted = clip.positions()[[0, 9, 17, 30]]
    for bone in ("leftHand", "rightHand", "leftFoot", "rightFoot", "head", "leftToes"):
        np.testing.assert_allclose(found[bone], wanted[:, BASE.index(bone)], atol=0.002, err_msg=bone)


def test_bvh_plays_in_place_and_between_frames(turning, tmp_path):
    registry.write(tmp_path / "move.bvh", Scene(turning))
    found = module(tmp_path, _BVH, str(tmp_path / "move.bvh"), needs="three")
    wanted = turning.positions()
    between = turning.resampled(60.0).positions()[19]
    frames = [wanted[0], wanted[9], between, wanted[17], wanted[30]]
    for joint, name in enumerate(BASE.joint_names):
        for row, place in enumerate(frames):
            # BVH is in centimetres; half-way frames within 5 mm
            atol = 0.005 if row == 2 else 0.001
            np.testing.assert_allclose(np.array(found[name][row]) / 100, place[joint], atol=atol, err_msg=name)
