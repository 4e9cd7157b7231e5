// The two services' HTTP interface, as far as the page needs it. Every failure is an Error with a sentence in it.

async function checked(response) {
  if (response.ok) return response;
  let problem = {};
  try {
    problem = await response.json();
  } catch {
    // not a problem document: the status has to do
  }
  const said = problem.detail || problem.title || `${response.status} ${response.statusText}`;
  throw new Error(problem.remedy ? `${said} ${problem.remedy}` : said);
}

async function request(path, options) {
  let response;
  try {
    response = await fetch(path, options);
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Error("The server does not answer. Is `roam demo` still running?");
  }
  return checked(response);
}

export const getJson = async (path) => (await request(path)).json();
export const getBytes = async (path) => (await request(path)).arrayBuffer();

const postJson = (path, body, options = {}) =>
  request(path, {
    method: "POST",
    body: JSON.stringify(body),
    ...options,
    headers: { "Content-Type": "application/json", ...options.headers },
  });

/** Uploads furniture to goalpose; `unit` and `up` are detected when not given. */
export async function uploadObject(bytes, { format, unit, up, piece }) {
  const query = new URLSearchParams({ format, ...(unit && { unit }), ...(up && { up }), ...(piece && { piece }) });
  const headers = { "Content-Type": "application/octet-stream" };
  return (await request(`/v1/objects?${query}`, { method: "POST", body: bytes, headers })).json();
}

/** The file's triangles, for display; read by the page's own server with the same reader as goalpose. */
export async function readTriangles(bytes, format) {
  const headers = { "Content-Type": "application/octet-stream" };
  return (await request(`/viewer/mesh?format=${format}`, { method: "POST", body: bytes, headers })).arrayBuffer();
}

/** Frames ({ root, rotations }) and the furniture's file as a file of another format (Blob). */
export async function saveMotion(frames, { format, source, transform }) {
  const width = 3 + frames[0].rotations.length;
  const table = new Float32Array(frames.length * width);
  frames.forEach((frame, i) => {
    table.set(frame.root, i * width);
    table.set(frame.rotations, i * width + 3);
  });
  const body = new Blob([new Uint32Array([frames.length, width]), table, source.bytes]);
  const query = new URLSearchParams({ format, object_format: source.format, transform: JSON.stringify(transform) });
  const headers = { "Content-Type": "application/octet-stream" };
  return (await request(`/viewer/save?${query}`, { method: "POST", body, headers })).blob();
}

/** Fits a pose; `onProgress` sees the optimisation settle. Answers the goal pose. */
export async function synthesize(body, { onProgress, signal }) {
  const response = await postJson("/v1/goal-poses", body, { headers: { Accept: "text/event-stream" }, signal });
  for await (const { event, data } of serverSentEvents(response.body)) {
    if (event === "progress") onProgress(data);
    else if (event === "goal_pose") return data;
    else if (event === "error") throw new Error(data.remedy ? `${data.detail} ${data.remedy}` : data.detail);
  }
  throw new Error("The goal-pose service ended the stream without an answer.");
}

async function* serverSentEvents(body) {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  let waiting = "";
  for (;;) {
    const { value, done } = await reader.read();
    if (done) return;
    waiting += value.replaceAll("\r\n", "\n");
    const parts = waiting.split("\n\n");
    waiting = parts.pop();
    for (const part of parts) {
      const field = (name) =>
        part.split("\n").filter((l) => l.startsWith(`${name}:`)).map((l) => l.slice(name.length + 1).trim()).join("\n");
      if (field("data")) yield { event: field("event"), data: JSON.parse(field("data")) };
    }
  }
}

export async function createSession(start, floorHeight) {
  return (await postJson("/v1/sessions", { start, floor_height: floorHeight, seed: 1 })).json();
}

export async function deleteSession(name) {
  await request(`/v1/${name}`, { method: "DELETE", keepalive: true }).catch(() => {});
}
