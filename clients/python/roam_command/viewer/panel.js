// What the page says in words and numbers: notes, HUD, energy curve, errors.

import { ACTION_NAMES } from "./messages.js";

const at = (id) => document.getElementById(id);
const LEFT_FEET = 0b0011, RIGHT_FEET = 0b1100; // contacts: leftFoot, leftToes, rightFoot, rightToes

export const setPhase = (text) => (at("hud-phase").textContent = text);

export function showFrame(frame, rate, distance) {
  at("hud-action").textContent = ACTION_NAMES[frame?.action ?? 0] || "–";
  at("hud-distance").textContent =
    distance === null ? "–" : distance < 0.995 ? `${(100 * distance).toFixed(1)} cm` : `${distance.toFixed(2)} m`;
  at("hud-rate").textContent = rate ? rate.toFixed(0) : "–";
  const [left, right] = at("hud-contacts").children;
  left.className = (frame?.contacts ?? 0) & LEFT_FEET ? "down" : "";
  right.className = (frame?.contacts ?? 0) & RIGHT_FEET ? "down" : "";
}

export function showError(message) {
  at("error").hidden = false;
  at("error").firstElementChild.textContent = message;
}

export function hideError() {
  at("error").hidden = true;
}

export function showObject(object) {
  const [low, high] = object.bounds;
  const size = high.map((value, i) => ((value - low[i]) * 100).toFixed(0)).join(" × ");
  at("object-note").textContent = `${size} cm (width × height × depth).`;
  showPieces(object.pieces ?? []);
  showWarnings(object.warnings ?? []);
}

/** What stands in a file of several; the chosen one can be changed. */
function showPieces(pieces) {
  at("pieces-row").hidden = pieces.length < 2;
  const title = ({ name, bounds: [low, high] }) =>
    `${name} (${high.map((value, i) => ((value - low[i]) * 100).toFixed(0)).join(" × ")} cm)`;
  at("pieces").replaceChildren(...pieces.map((piece) => new Option(title(piece), piece.name, false, piece.chosen)));
}

/** Doubts that a person should see before trusting the result, such as a seat too short to lie on. */
export function showWarnings(warnings) {
  at("warnings").hidden = warnings.length === 0;
  at("warnings").textContent = warnings.map((warning) => warning.message).join(" ");
}

export function showTime(shown, newest, live) {
  const slider = at("timeline");
  slider.disabled = newest === null;
  if (newest === null) return;
  slider.max = newest.toFixed(2);
  if (live) slider.value = slider.max;
  const text = live ? "live" : `${shown.toFixed(1)} s of ${newest.toFixed(1)} s; the right end is live`;
  if (at("timeline-note").textContent !== text) at("timeline-note").textContent = text;
}

export function showPose(goal) {
  const centimetres = (metres) => (metres === undefined ? "–" : `${(100 * metres).toFixed(1)} cm`);
  const { hip_seat_distance: hips, penetration_depth: depth } = goal.diagnostics;
  at("pose-note").innerHTML =
    `hips to seat <b>${centimetres(hips)}</b>, penetration <b>${centimetres(depth)}</b>, ` +
    `energy <b>${goal.energies.total.toFixed(3)}</b> in <b>${goal.seconds.toFixed(1)} s</b>`;
}

export function showPoseText(text) {
  at("pose-note").textContent = text;
}

/** Draws the best energy so far over the iterations, on a logarithmic scale. */
export function drawEnergy(points, iterationCount) {
  const canvas = at("energy"), context = canvas.getContext("2d");
  const { width, height } = canvas;
  context.clearRect(0, 0, width, height);
  const finite = points.filter(({ energy }) => energy > 0);
  if (finite.length < 2) return;
  const logs = finite.map(({ energy }) => Math.log(energy));
  const low = Math.min(...logs), span = Math.max(...logs) - low || 1;
  const x = (iteration) => 12 + ((width - 24) * iteration) / Math.max(iterationCount, 1);
  const y = (log) => 14 + (height - 28) * (1 - (log - low) / span);
  shadeStages(context, finite, x, height);
  context.beginPath();
  finite.forEach(({ iteration }, i) => context.lineTo(x(iteration), y(logs[i])));
  Object.assign(context, { lineWidth: 4, lineJoin: "round", strokeStyle: "#2f6f8f" });
  context.stroke();
  context.beginPath();
  context.arc(x(finite.at(-1).iteration), y(logs.at(-1)), 7, 0, 2 * Math.PI);
  context.fillStyle = "#d9632b";
  context.fill();
}

function shadeStages(context, points, x, height) {
  context.strokeStyle = "rgb(47 111 143 / 0.35)";
  context.lineWidth = 2;
  for (let i = 1; i < points.length; i++) {
    if (points[i].stage === points[i - 1].stage) continue;
    context.beginPath();
    context.moveTo(x(points[i].iteration), 0);
    context.lineTo(x(points[i].iteration), height);
    context.stroke();
  }
}
