// The stand-in body: one capsule per bone on a tree of joints, dressed so that front, arms and legs can be told apart.

import * as THREE from "three";

const CLOTHES = {
  skin: { color: 0xd9a37e, roughness: 0.65 },
  shirt: { color: 0x4c86ab, roughness: 0.85 },
  trousers: { color: 0x44546a, roughness: 0.9 },
  shoes: { color: 0x7a4a2f, roughness: 0.6 },
  hair: { color: 0x33241c, roughness: 0.95 },
};

const GHOST_OPACITY = 0.28;

function clothing(bone) {
  if (/foot|toes/i.test(bone)) return "shoes";
  if (/^hips|leg/i.test(bone)) return "trousers";
  if (/head|neck|hand|lowerarm/i.test(bone)) return "skin";
  return "shirt";
}

export class Character {
  /** `skeleton` as GET /v1/skeletons/default tells it. `ghost` draws a pale see-through body. */
  constructor(skeleton, { ghost = false } = {}) {
    this.skeleton = skeleton;
    this.ghost = ghost;
    this.group = new THREE.Group();
    this.joints = skeleton.joint_names.map((name, i) => {
      const joint = new THREE.Group();
      joint.name = name;
      joint.position.fromArray(skeleton.rest_offsets[i]);
      joint.quaternion.fromArray(skeleton.rest_rotations[i]);
      return joint;
    });
    skeleton.parents.forEach((parent, i) => (parent < 0 ? this.group : this.joints[parent]).add(this.joints[i]));
    this.materials = ghost ? ghostMaterials() : clothMaterials();
    for (const capsule of skeleton.body) this.addCapsule(capsule);
    this.addFace();
    this.group.visible = false;
  }

  addCapsule({ joint, start, end, radius }) {
    const from = new THREE.Vector3(...start), to = new THREE.Vector3(...end);
    const axis = to.clone().sub(from);
    const bone = this.skeleton.humanoid_bones[joint] || this.skeleton.joint_names[joint];
    const mesh = new THREE.Mesh(
      new THREE.CapsuleGeometry(radius, axis.length(), 8, 20),
      this.materials[clothing(bone)],
    );
    mesh.position.copy(from).add(to).multiplyScalar(0.5);
    if (axis.lengthSq() > 1e-10) {
      mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), axis.normalize());
    }
    this.addMesh(this.joints[joint], mesh);
  }

  /** Eyes and hair: a head without a front cannot show where a person looks. */
  addFace() {
    const index = this.skeleton.humanoid_bones.indexOf("head");
    const capsule = this.skeleton.body.find(({ joint }) => joint === index);
    if (!capsule) return;
    const centre = new THREE.Vector3(...capsule.end);
    for (const side of [-1, 1]) {
      const eye = new THREE.Mesh(new THREE.SphereGeometry(capsule.radius * 0.13, 12, 8), this.materials.hair);
      eye.position.copy(centre).add(new THREE.Vector3(side * 0.36, 0.05, 0.9).multiplyScalar(capsule.radius));
      this.addMesh(this.joints[index], eye);
    }
    const hair = new THREE.Mesh(
      new THREE.SphereGeometry(capsule.radius * 1.06, 24, 16, 0, 2 * Math.PI, 0, Math.PI * 0.55),
      this.materials.hair,
    );
    hair.position.copy(centre);
    hair.rotation.x = -0.35;
    this.addMesh(this.joints[index], hair);
  }

  addMesh(joint, mesh) {
    mesh.castShadow = !this.ghost;
    mesh.receiveShadow = !this.ghost;
    joint.add(mesh);
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
    this.materials.skin.opacity = GHOST_OPACITY * share;
  }

  get hips() {
    return this.joints[0].position;
  }
}

function clothMaterials() {
  return Object.fromEntries(
    Object.entries(CLOTHES).map(([name, look]) => [name, new THREE.MeshStandardMaterial({ metalness: 0, ...look })]),
  );
}

function ghostMaterials() {
  const material = new THREE.MeshStandardMaterial({
    color: 0x18a999, emissive: 0x0b5a52, roughness: 1, transparent: true, opacity: GHOST_OPACITY, depthWrite: false,
  });
  return Object.fromEntries(Object.keys(CLOTHES).map((name) => [name, material]));
}
