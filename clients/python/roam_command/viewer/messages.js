// The messages of roam/v1/motion.proto and skeleton.proto that the page reads and writes, as tables for protobuf.js.

export const Action = { UNSPECIFIED: 0, IDLE: 1, WALK: 2, SIT: 3, LIE: 4 };
export const ACTION_NAMES = ["", "idle", "walk", "sit", "lie"];
export const Encoding = { FLOAT32: 1, SNORM16: 2, DELTA16: 3 };
export const Pacing = { REALTIME: 1, CREDIT: 2, BURST: 3 };
export const EventType = {
  GOAL_REACHED: 1, FRAMES_SKIPPED: 2, DRAINING: 3, CONTROL_APPLIED: 4, SESSION_ENDED: 5, WARNING: 6,
};

const Tip = { 1: ["name", "string"], 2: ["joint", "uint32"], 3: ["offset", "float", "repeated"] };

export const Skeleton = {
  1: ["id", "string"],
  2: ["joint_names", "string", "repeated"],
  3: ["parents", "sint32", "repeated"],
  4: ["rest_offsets", "bytes"],
  5: ["rest_rotations", "bytes"],
  6: ["humanoid_bones", "string", "repeated"],
  7: ["tips", Tip, "repeated"],
};

export const Pose = { 1: ["skeleton_id", "string"], 2: ["root_position", "bytes"], 3: ["rotations", "bytes"] };

export const StreamHeader = {
  1: ["session", "string"],
  2: ["skeleton", Skeleton],
  3: ["rotation_encoding", "enum"],
  4: ["frame_rate", "float"],
  5: ["first_sequence", "fixed32"],
  6: ["discontinuity", "bool"],
  7: ["contact_joints", "uint32", "repeated"],
  8: ["resume_token", "string"],
  9: ["last_control_id", "uint64"],
  10: ["exact", "bool"],
  11: ["pacing", "enum"],
};

export const Frame = {
  1: ["sequence", "fixed32"],
  2: ["time", "double"],
  3: ["root", "bytes"],
  4: ["rotations", "bytes"],
  5: ["contacts", "fixed32"],
  6: ["action", "enum"],
  7: ["goal_distance", "float"],
  8: ["joint_positions", "bytes"],
};

export const SessionEvent = {
  1: ["type", "enum"],
  2: ["sequence", "fixed32"],
  3: ["message", "string"],
  5: ["control_id", "uint64"],
  6: ["goal_pose", "string"],
  7: ["skipped_count", "uint32"],
};

export const AnimateResponse = { 1: ["header", StreamHeader], 2: ["frame", Frame], 3: ["event", SessionEvent] };

export const Steer = {
  1: ["velocity_x", "float"],
  2: ["velocity_z", "float"],
  3: ["facing", "float"],
  4: ["action", "enum"],
};

export const Outline = { 1: ["corners", "float", "repeated"] };

export const Volume = {
  1: ["origin", "float", "repeated"],
  2: ["pitch", "float"],
  3: ["yaw", "float"],
  4: ["size", "uint32", "repeated"],
  5: ["values", "bytes"],
};

export const Goal = {
  1: ["goal_pose", "string"],
  2: ["pose", Pose],
  3: ["action", "enum"],
  5: ["obstacles", Outline, "repeated"],
  6: ["volume", Volume],
};
export const Playback = { 1: ["paused", "bool"] };

export const ControlInput = {
  1: ["steer", Steer],
  2: ["goal", Goal],
  3: ["playback", Playback],
  15: ["control_id", "uint64"],
};

export const Open = {
  1: ["session", "string"],
  2: ["after_sequence", "fixed32"],
  3: ["resume_token", "string"],
  4: ["known_skeleton_id", "string"],
  5: ["rotation_encodings", "enum", "repeated"],
  6: ["pacing", "enum"],
  7: ["credit", "uint32"],
  8: ["joint_positions", "bool"],
};

export const Ack = { 1: ["sequence", "fixed32"], 2: ["credit", "uint32"] };
export const AnimateRequest = { 1: ["open", Open], 2: ["control", ControlInput], 3: ["ack", Ack] };
