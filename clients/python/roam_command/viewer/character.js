// The figure on the screen: a skinned body from a GLB whose joints are named as the skeleton's.

import * as THREE from "three";
import { GLTFLoader } from "./vendor/three/loaders/GLTFLoader.js";
import { clone } from "./vendor/three/utils/SkeletonUtils.js";

const GHOST_OPACITY = 0.34;

/** The body that every character is a copy of. */
export async function loadFigure(address) {
  return (await new GLTFLoader().loadAsync(address)).scene;
}

export class Character {
  /** `skeleton` as GET /v1/skeletons/default tells it, `figure` from loadFigure. `ghost` draws a pale see-through body. */
  constructor(skeleton, figure, { ghost = false } = {}) {
    this.group = new THREE.Group();
    this.group.add(clone(figure));
    this.joints = skeleton.joint_names.map((name) => {
      const joint = this.group.getObjectByName(THREE.PropertyBinding.sanitizeNodeName(name));
      if (!joint) throw new Error(`The figure has no joint ${name}.`);
      return joint;
    });
    this.material = ghost ? ghostMaterial() : null;
    this.group.traverse((part) => {
      if (!part.isMesh) return;
      part.frustumCulled = false; // its sphere is that of the rest pose
      part.castShadow = part.receiveShadow = !ghost;
      if (ghost) part.material = this.material;
    });
    this.group.visible = false;
  }

  /** `root` world position [3], `rotations` local quaternions xyzw, flat [4 J] or nested [J][4]. */
  setPose(root, rotations) {
    const nested = Array.isArray(rotations[0]);
    this.joints[0].position.fromArray(root);
    this.joints.forEach((joint, i) => {
      joint.quaternion.fromArray(nested ? rotations[i] : rotations, nested ? 0 : 4 * i).normalize();
    });
    this.group.visible = true;
  }

  /** Between two frames, 0 ≤ share ≤ 1. */
  setBetween(a, b, share) {
    const p = this.joints[0].position.fromArray(a.root);
    p.lerp(new THREE.Vector3(...b.root), share);
    const from = new THREE.Quaternion(), to = new THREE.Quaternion();
    this.joints.forEach((joint, i) => {
      from.fromArray(a.rotations, 4 * i).normalize();
      to.fromArray(b.rotations, 4 * i).normalize();
      joint.quaternion.slerpQuaternions(from, to, share);
    });
    this.group.visible = true;
  }

  /** 0 hides a ghost, 1 shows it as pale as it gets. */
  fade(share) {
    this.material.opacity = GHOST_OPACITY * share;
    this.material.visible = share > 0.02;
  }

  get hips() {
    return this.joints[0].position;
  }
}

function ghostMaterial() {
  return new THREE.MeshStandardMaterial({
    color: 0x18a999, emissive: 0x0b5a52, roughness: 1, transparent: true, opacity: GHOST_OPACITY,
  });
}
