// The demo: object -> goal pose -> walking character. Wires the page's parts together; each part is in its own file.

import * as THREE from "three";
import { Character, loadFigure } from "./character.js";
import { makeFurniture, readMesh } from "./furniture.js";
import { Action, EventType } from "./messages.js";
import * as panel from "./panel.js";
import { Playback } from "./playback.js";
import { packFloats } from "./protobuf.js";
import * as services from "./services.js";
import { Stage } from "./stage.js";
import { Steering } from "./steering.js";
import { FrameStream } from "./stream.js";

const START_DISTANCE = 3; // [m] in front of the goal pose
const STEER_EVERY = 100; // [ms]

const at = (id) => document.getElementById(id);
const stage = new Stage(at("stage"));
const playback = new Playback();
const steering = new Steering();

let character, ghost, furniture, object, source, goal, session, stream;
let chosen = "0"; // value of the selector for the object in use
let uploads = 0; // counts what was asked for: an answer that comes after a newer question is dropped
let ownFile = null;
let work = null; // AbortController of the goal pose being made
let phase = "loading";
let paused = false;
let steered = false;

function setPhase(text) {
  phase = text;
  panel.setPhase(text);
}

/** Runs what a button or file started; a failure becomes text on the page. */
async function attempt(action) {
  panel.hideError();
  const before = phase;
  try {
    await action();
  } catch (error) {
    if (error.name === "AbortError") return;
    // What runs goes on: a file that cannot be used takes nothing away.
    setPhase(stream ? before : "stopped");
    panel.showError(error.message);
  } finally {
    at("objects").value = chosen;
    enableButtons();
  }
}

function enableButtons() {
  at("sit").disabled = at("lie").disabled = !object;
  at("stand").disabled = at("pause").disabled = !stream;
  at("restart").disabled = !goal;
  at("save").disabled = !goal;
  at("sit").classList.toggle("current", goal?.action === "sit");
  at("lie").classList.toggle("current", goal?.action === "lie");
}

// Object

async function useObject(bytes, options) {
  const mine = ++uploads;
  setPhase("reading the object");
  // First the service, which reads files in a process of its own; only what it took is read for display.
  const received = await services.uploadObject(bytes, options);
  const triangles = await services.readTriangles(bytes, options.format);
  if (mine !== uploads) return;
  work?.abort();
  await endSession();
  goal = undefined;
  object = received;
  source = { ...options, bytes };
  chosen = options.value;
  showChosen(options.title);
  if (furniture) {
    stage.scene.remove(furniture);
    furniture.geometry.dispose();
  }
  furniture = makeFurniture(readMesh(triangles), object.object_to_world);
  stage.scene.add(furniture);
  const [low, high] = object.bounds;
  stage.frame(new THREE.Vector3((low[0] + high[0]) / 2, object.floor_height, (low[2] + high[2]) / 2), 0);
  panel.showObject(object);
  await makePose("sit");
}

/** The selector names what is in use; a file of one's own is one more entry. */
function showChosen(title) {
  if (chosen === "own") {
    const entry = [...at("objects").options].find(({ value }) => value === "own") ?? new Option("", "own");
    entry.text = title;
    at("objects").add(entry);
  }
  at("objects").value = chosen;
}

async function useFile(file) {
  const format = file.name.split(".").pop().toLowerCase();
  await useObject(await file.arrayBuffer(), { format, value: "own", title: file.name });
  ownFile = file;
}

async function useBundled({ address, format, unit, up }, value) {
  await useObject(await services.getBytes(address), { format, unit, up, value });
}

// Goal pose

async function makePose(action) {
  work?.abort();
  work = new AbortController();
  const points = [];
  panel.drawEnergy(points, 0);
  setPhase(`fitting: ${action}`);
  panel.showPoseText("looking for a pose that fits …");
  ghost.group.visible = false;
  if (!stream) character.group.visible = false;
  const onProgress = (progress) => {
    points.push(progress);
    panel.drawEnergy(points, progress.iteration_count);
    panel.showPoseText(`${progress.stage_name}, ${progress.iteration} of ${progress.iteration_count} iterations`);
    if (progress.pose) ghost.setPose(progress.pose.root_position, progress.pose.rotations);
  };
  const began = performance.now();
  goal = await services.synthesize({ object: object.name, action, seed: 1 }, { onProgress, signal: work.signal });
  goal.seconds = (performance.now() - began) / 1000;
  goal.action = action;
  ghost.setPose(goal.pose.root_position, goal.pose.rotations);
  ghost.group.visible = at("ghost").checked;
  panel.showPose(goal);
  panel.showWarnings([...(object.warnings ?? []), ...(goal.warnings ?? [])]);
  if (!stream) await beginSession();
  goToGoal();
}

function goalYaw() {
  const [x, y, z, w] = goal.pose.rotations[0];
  return Math.atan2(2 * (x * z + y * w), 1 - 2 * (x * x + y * y));
}

// Motion

async function beginSession() {
  const yaw = goalYaw(), [x, , z] = goal.pose.root_position;
  const start = {
    x: x + START_DISTANCE * Math.sin(yaw), z: z + START_DISTANCE * Math.cos(yaw), yaw: yaw + Math.PI,
  };
  stage.frame(stage.centre, yaw);
  playback.clear();
  session = await services.createSession(start, goal.floor_height ?? object.floor_height);
  stream = new FrameStream(session.name, {
    frame: receiveFrame,
    event: receiveEvent,
    state: (text) => text === "reconnecting" && setPhase(text),
    failed: (message) => {
      stream = undefined;
      setPhase("stopped");
      panel.showError(message);
      enableButtons();
    },
  });
  setPaused(false);
}

async function endSession() {
  const ended = session;
  stream?.close();
  // Before anything is waited for: a key pressed meanwhile must not go to a session that is on its way out.
  stream = session = undefined;
  steering.stop();
  stage.showMarker(null);
  enableButtons();
  if (ended) await services.deleteSession(ended.name);
}

function receiveFrame(frame) {
  if (phase === "reconnecting") setPhase("walking to the goal");
  if (phase === "walking to the goal" && frame.action === Action.SIT) setPhase("sitting down");
  if (phase === "walking to the goal" && frame.action === Action.LIE) setPhase("lying down");
  if (phase === "standing up" && frame.action === Action.IDLE) setPhase("standing");
  playback.push(frame);
}

function receiveEvent(event) {
  if (event.type === EventType.GOAL_REACHED) setPhase("goal reached");
  if (event.type === EventType.DRAINING) setPhase("server is stopping");
}

function goToGoal() {
  steering.stop();
  stage.showMarker(null);
  setPhase("walking to the goal");
  const pose = {
    skeleton_id: goal.pose.skeleton_id,
    root_position: packFloats(goal.pose.root_position),
    rotations: packFloats(goal.pose.rotations),
  };
  const action = goal.action === "lie" ? Action.LIE : Action.SIT;
  const obstacles = (goal.footprint ?? []).map((corners) => ({ corners: corners.flat() }));
  const values = Uint8Array.from(atob(goal.volume.values), (letter) => letter.charCodeAt(0));
  const volume = { ...goal.volume, values };
  stream.control({ goal: { goal_pose: goal.name, pose, action, obstacles, volume } });
}

function standUp() {
  steering.stop();
  setPhase("standing up");
  stream.control({ steer: { velocity_x: 0, velocity_z: 0, action: Action.IDLE } });
}

async function restart() {
  await endSession();
  await beginSession();
  goToGoal();
  enableButtons();
}

function setPaused(value) {
  paused = value;
  at("pause").textContent = paused ? "Play" : "Pause";
  at("pause").setAttribute("aria-pressed", String(paused));
}

function togglePause() {
  setPaused(!paused);
  stream.control({ playback: { paused } });
}

/** Sends what the keys or the clicked place ask for, ten times a second while they ask. */
function steer() {
  if (!stream || !playback.newest) return;
  const velocity = steering.velocity(character.hips, stage.viewYaw);
  if (velocity) {
    steered = true;
    setPhase("steered by hand");
    stream.control({ steer: { velocity_x: velocity.x, velocity_z: velocity.z } });
  } else if (steered) {
    steered = false;
    stage.showMarker(null);
    setPhase("standing");
    stream.control({ steer: { velocity_x: 0, velocity_z: 0 } });
  }
}

// Files

async function save() {
  const format = at("save-format").value;
  const frames = playback.frames.length ? playback.frames : [{
    root: goal.pose.root_position, rotations: goal.pose.rotations.flat(),
  }];
  const blob = format === "png"
    ? await stage.picture()
    : await services.saveMotion(frames, { format, source, transform: object.object_to_world });
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = `${goal.action}.${format}`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

// Input

function bindButtons() {
  at("sit").onclick = () => attempt(() => makePose("sit"));
  at("lie").onclick = () => attempt(() => makePose("lie"));
  at("stand").onclick = standUp;
  at("restart").onclick = () => attempt(restart);
  at("pause").onclick = togglePause;
  at("follow").onchange = (event) => (stage.follow = event.target.checked);
  at("ghost").onchange = (event) => (ghost.group.visible = event.target.checked && Boolean(goal));
  at("file").onchange = (event) => {
    const [file] = event.target.files;
    event.target.value = ""; // the same file may be chosen again
    if (file) attempt(() => useFile(file));
  };
  at("upload").onclick = () => at("file").click();
  at("pieces").onchange = (event) =>
    attempt(() => useObject(source.bytes, { ...source, piece: event.target.value, value: chosen }));
  // The right end is live; steps and the moving end differ by a rounding.
  at("timeline").oninput = ({ target: { value, max } }) => (playback.held = value > max - 0.02 ? null : Number(value));
  at("save").onclick = () => attempt(save);
  at("error").querySelector("button").onclick = panel.hideError;
  addEventListener("beforeunload", () => session && services.deleteSession(session.name));
}

function bindKeys() {
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || /SELECT|INPUT/.test(event.target.tagName)) return;
    const onButton = /BUTTON|LABEL/.test(event.target.tagName);
    if (stream && steering.press(event.code)) event.preventDefault();
    else if (event.code === "Space" && stream && !onButton) {
      event.preventDefault();
      togglePause();
    } else if (event.code === "KeyR" && goal) attempt(restart);
    else if (event.code === "KeyF") at("follow").click();
  });
  addEventListener("keyup", (event) => steering.release(event.code));
  addEventListener("blur", () => steering.stop());
}

function bindStage() {
  let down = null;
  at("stage").addEventListener("pointerdown", (event) => (down = [event.clientX, event.clientY]));
  at("stage").addEventListener("pointerup", (event) => {
    const dragged = !down || Math.hypot(event.clientX - down[0], event.clientY - down[1]) > 4;
    const place = dragged || event.button !== 0 || !stream ? null : stage.floorPoint(event);
    if (!place) return;
    steering.walkTo(place);
    stage.showMarker(place);
  });
}

function bindDrop() {
  addEventListener("dragover", (event) => {
    event.preventDefault();
    at("drop").hidden = false;
  });
  addEventListener("dragleave", (event) => event.relatedTarget === null && (at("drop").hidden = true));
  addEventListener("drop", (event) => {
    event.preventDefault();
    at("drop").hidden = true;
    const [file] = event.dataTransfer.files;
    if (file) attempt(() => useFile(file));
  });
}

// The picture

/** Mean joint distance when the server tells it (near the goal), else how far the hips are from it on the floor. */
function distanceToGoal() {
  const frame = stream && playback.newest;
  if (!frame || !goal) return null;
  if (frame.goal_distance !== undefined) return frame.goal_distance;
  const [x, , z] = goal.pose.root_position;
  return Math.hypot(frame.root[0] - x, frame.root[2] - z);
}

let last = performance.now();
let drawn = 0;
let hideCharacter = false;
function draw(now) {
  const seconds = Math.min(0.25, (now - last) / 1000);
  last = now;
  if (stream && playback.show(character, paused ? 0 : seconds)) stage.followPoint(character.hips, seconds);
  panel.showTime(playback.held ?? 0, stream && playback.newest ? playback.newest.time : null, playback.held === null);
  // Where the character takes the goal pose, the ghost makes room for it.
  ghost.fade(Math.min(1, (distanceToGoal() ?? 1) / 0.4));
  panel.showFrame(stream ? playback.newest : null, paused ? 0 : playback.rate, distanceToGoal());
  if (hideCharacter) character.group.visible = false;
  stage.draw();
  drawn += 1;
  requestAnimationFrame(draw);
}

async function begin() {
  const [skeleton, { objects }, figure] = await Promise.all([
    services.getJson("/v1/skeletons/default"),
    services.getJson("/viewer/objects"),
    loadFigure("/viewer/figure.glb"),
  ]);
  character = new Character(skeleton, figure);
  ghost = new Character(skeleton, figure, { ghost: true });
  stage.scene.add(character.group, ghost.group);
  for (const [i, { title }] of objects.entries()) at("objects").add(new Option(title, i));
  at("objects").onchange = (event) => {
    const { value } = event.target;
    attempt(() => (value === "own" ? useFile(ownFile) : useBundled(objects[value], value)));
  };
  bindButtons();
  bindKeys();
  bindStage();
  bindDrop();
  setInterval(steer, STEER_EVERY);
  requestAnimationFrame(draw);
  await useBundled(objects[0], "0");
}

// What the screenshot test asks: it compares the picture with and without the character.
window.roam = {
  get phase() { return phase; },
  get session() { return stream && session.name; },
  get frames() { return playback.newest?.sequence ?? 0; },
  get action() { return playback.newest?.action ?? 0; },
  get goalDistance() { return distanceToGoal(); },
  get drawn() { return drawn; },
  get hips() { return character.hips.toArray(); },
  hideCharacter(hidden) { hideCharacter = hidden; },
};

attempt(begin);
