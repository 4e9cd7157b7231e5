// The room: light, floor, camera. Everything stands where the object file puts it, in metres, Y up.

import * as THREE from "three";
import { OrbitControls } from "./vendor/three/OrbitControls.js";

const BACKDROP = 0xdde3ea;

/** True where no graphics card draws: then the picture leaves out what costs most. */
function drawsInSoftware() {
  const probe = document.createElement("canvas").getContext("webgl2");
  const info = probe?.getExtension("WEBGL_debug_renderer_info");
  const name = info ? probe.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
  probe?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

export class Stage {
  constructor(canvas) {
    this.canvas = canvas;
    this.lean = drawsInSoftware();
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !this.lean });
    this.renderer.setPixelRatio(this.lean ? 1 : Math.min(window.devicePixelRatio, 2));
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    this.renderer.toneMapping = THREE.ACESFilmicToneMapping;
    this.renderer.toneMappingExposure = 1.05;
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color(BACKDROP);
    this.scene.fog = new THREE.Fog(BACKDROP, 9, 22);
    this.camera = new THREE.PerspectiveCamera(40, 1, 0.05, 60);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.controls.maxPolarAngle = Math.PI * 0.495;
    this.controls.minDistance = 0.8;
    this.controls.maxDistance = 14;
    this.floorHeight = 0;
    this.follow = true;
    this.addLights();
    this.addFloor();
    this.addMarker();
    this.frame(new THREE.Vector3(0, 0, 0), 0);
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  addLights() {
    this.scene.add(new THREE.HemisphereLight(0xf4f8ff, 0xb0a59a, 1.9));
    this.sun = new THREE.DirectionalLight(0xfff1dd, 2.6);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.setScalar(this.lean ? 768 : 2048);
    this.sun.shadow.radius = 5;
    this.sun.shadow.bias = -0.0004;
    this.sun.shadow.normalBias = 0.02;
    Object.assign(this.sun.shadow.camera, { left: -4, right: 4, top: 4, bottom: -4, near: 0.5, far: 16 });
    const fill = new THREE.DirectionalLight(0xcfe0ff, 0.7);
    fill.position.set(-4, 3, -3);
    this.scene.add(this.sun, this.sun.target, fill);
  }

  addFloor() {
    this.floor = new THREE.Group();
    const ground = new THREE.Mesh(
      new THREE.CircleGeometry(30, 64),
      new THREE.MeshStandardMaterial({ color: 0xe4e8ec, roughness: 0.95 }),
    );
    ground.rotation.x = -Math.PI / 2;
    ground.receiveShadow = true;
    const grid = new THREE.GridHelper(24, 24, 0x6f7f8e, 0x93a1ae); // one metre a square
    grid.material.transparent = true;
    grid.material.opacity = 0.55;
    grid.position.y = 0.002;
    this.ground = ground;
    this.floor.add(ground, grid);
    this.scene.add(this.floor);
  }

  /** The ring that shows where a click sent the character. */
  addMarker() {
    this.marker = new THREE.Mesh(
      new THREE.RingGeometry(0.14, 0.19, 40),
      new THREE.MeshBasicMaterial({ color: 0xd9632b, transparent: true, opacity: 0.9 }),
    );
    this.marker.rotation.x = -Math.PI / 2;
    this.marker.visible = false;
    this.floor.add(this.marker);
  }

  showMarker(place) {
    this.marker.visible = place !== null;
    if (place) this.marker.position.set(place.x, 0.006, place.z);
  }

  /** Looks at an object whose centre is on the floor at `centre`, from its front (heading `yaw` [rad]) and aside. */
  frame(centre, yaw) {
    this.floorHeight = centre.y;
    this.floor.position.set(0, centre.y, 0);
    const direction = yaw + 0.75;
    const distance = 4.8;
    this.controls.target.set(centre.x, centre.y + 0.75, centre.z);
    this.camera.position.set(
      centre.x + distance * Math.sin(direction), centre.y + 2.1, centre.z + distance * Math.cos(direction),
    );
    this.centre = centre.clone();
    this.lightAt(centre);
  }

  lightAt(point) {
    this.sun.position.set(point.x + 2.5, this.floorHeight + 5.5, point.z + 2.8);
    this.sun.target.position.set(point.x, this.floorHeight, point.z);
  }

  /** Where a click meets the floor, or null. */
  floorPoint(event) {
    const box = this.canvas.getBoundingClientRect();
    const x = ((event.clientX - box.left) / box.width) * 2 - 1;
    const y = 1 - ((event.clientY - box.top) / box.height) * 2;
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2(x, y), this.camera);
    const [hit] = ray.intersectObject(this.ground);
    return hit && hit.distance < 20 ? hit.point : null;
  }

  /** Moves the view so that both the character and the object stay in it. */
  followPoint(hips, seconds) {
    if (!this.follow) return;
    const wanted = new THREE.Vector3(hips.x, this.floorHeight + 0.75, hips.z)
      .lerp(new THREE.Vector3(this.centre.x, this.floorHeight + 0.75, this.centre.z), 0.45);
    const step = wanted.sub(this.controls.target).multiplyScalar(1 - Math.exp(-2.5 * seconds));
    this.controls.target.add(step);
    this.camera.position.add(step);
    this.lightAt(this.controls.target);
  }

  /** The ground direction that the camera looks to, as a yaw [rad]. */
  get viewYaw() {
    const d = this.controls.target.clone().sub(this.camera.position);
    return Math.atan2(d.x, d.z);
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    // The panel covers the left of a wide window or the lower part of a narrow one: the middle of the picture is the
    // middle of what is left.
    const wide = width > 820;
    this.camera.setViewOffset(width, height, wide ? -150 : 0, wide ? 0 : 0.2 * height, width, height);
  }

  /** The picture as a PNG file (Blob). */
  picture() {
    this.draw(); // in the same task: a canvas forgets its picture after it was shown
    return new Promise((resolve) => this.canvas.toBlob(resolve, "image/png"));
  }

  draw() {
    this.controls.update();
    this.renderer.render(this.scene, this.camera);
  }
}
