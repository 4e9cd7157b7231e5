// The uploaded object: its triangles, or its points when the file has no triangles.

import * as THREE from "three";

/** Reads /viewer/mesh: vertex count, face count (uint32), float32 [V, 3], uint32 [F, 3], little-endian. */
export function readMesh(buffer) {
  const [vertices, faces] = new Uint32Array(buffer, 0, 2);
  return {
    positions: new Float32Array(buffer, 8, 3 * vertices),
    indices: new Uint32Array(buffer, 8 + 12 * vertices, 3 * faces),
  };
}

/** An object of three.js; `transform` [4][4] brings file coordinates to the world. */
export function makeFurniture({ positions, indices }, transform) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
  geometry.applyMatrix4(new THREE.Matrix4().set(...transform.flat()));
  if (indices.length === 0) {
    return new THREE.Points(geometry, new THREE.PointsMaterial({ color: 0x8a6a4c, size: 0.012 }));
  }
  geometry.setIndex(new THREE.BufferAttribute(indices, 1));
  // Files may share vertices across edges; separate triangles show every plank and edge as it is.
  const flat = geometry.toNonIndexed();
  flat.computeVertexNormals();
  const material = new THREE.MeshStandardMaterial({ color: 0xb58a60, roughness: 0.75, side: THREE.DoubleSide });
  const mesh = new THREE.Mesh(flat, material);
  mesh.castShadow = true;
  mesh.receiveShadow = true;
  return mesh;
}
