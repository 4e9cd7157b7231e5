"""Both services without networks: a three-joint figure that glides to its goal. For tests of the client only."""

import threading
import time
from collections.abc import Iterable, Iterator
from concurrent import futures
from contextlib import contextmanager
from dataclasses import dataclass, field

import grpc
import numpy as np
from google.protobuf import any_pb2, duration_pb2
from google.rpc import error_details_pb2, status_pb2
from grpc_status import rpc_status
from roam.v1 import (
    goal_pose_pb2,
    goal_pose_pb2_grpc,
    motion_pb2,
    motion_pb2_grpc,
    server_pb2,
    server_pb2_grpc,
    skeleton_pb2,
    skeleton_pb2_grpc,
)

NAMES = ("hips", "spine", "head")
OFFSETS = np.array([[0, 0.9, 0], [0, 0.3, 0], [0, 0.4, 0]], np.float32)
IDENTITY = np.tile(np.array([0, 0, 0, 1], np.float32), (3, 1))
FRAME_RATE = 30.0
FRAMES_TO_GOAL = 20


def f4(values) -> bytes:
    return np.ascontiguousarray(values, "<f4").tobytes()


SKELETON = skeleton_pb2.Skeleton(
    id="sha256:fake",
    joint_names=NAMES,
    parents=[-1, 0, 1],
    rest_offsets=f4(OFFSETS),
    rest_rotations=f4(IDENTITY),
    humanoid_bones=NAMES,
    tips=[skeleton_pb2.Tip(name="headTop", joint=2, offset=[0, 0.2, 0])],
)
BODY = [skeleton_pb2.Capsule(joint=1, start=[0, 0, 0], end=[0, 0.4, 0], radius=0.1)]


def abort(context, code, message, reason, *, remedy="", field=None, retry_after=None):
    details = [error_details_pb2.ErrorInfo(reason=reason, domain="roam", metadata={"remedy": remedy})]
    if field:
        violation = error_details_pb2.BadRequest.FieldViolation(field=field, description=message)
        details.append(error_details_pb2.BadRequest(field_violations=[violation]))
    if retry_after:
        delay = duration_pb2.Duration(seconds=int(retry_after))
        details.append(error_details_pb2.RetryInfo(retry_delay=delay))
    packed = []
    for detail in details:
        packed.append(any_pb2.Any())
        packed[-1].Pack(detail)
    context.abort_with_status(
        rpc_status.to_status(status_pb2.Status(code=code.value[0], message=message, details=packed))
    )


def pose_at(x: float, y: float, z: float) -> skeleton_pb2.Pose:
    return skeleton_pb2.Pose(skeleton_id=SKELETON.id, root_position=f4([x, y, z]), rotations=f4(IDENTITY))


def positions_of(root) -> np.ndarray:
    root = np.asarray(root, np.float32)
    return np.stack([root, root + OFFSETS[1], root + OFFSETS[1] + OFFSETS[2]])


class GoalPoses(goal_pose_pb2_grpc.GoalPoseServiceServicer):
    """Any upload is a chair; the goal is half a metre above its floor."""

    def __init__(self) -> None:
        self.uploads: list[goal_pose_pb2.UploadObjectRequest] = []
        self.requests: list[goal_pose_pb2.SynthesizeRequest] = []
        self.created: list[goal_pose_pb2.CreateReferencePoseRequest] = []
        self.floor = 0.25
        self.slow = threading.Event()  # set: ListReferencePoses waits for the caller to give up

    def _object(self, format: str) -> goal_pose_pb2.Object:
        matrix = np.diag([0.01, 0.01, 0.01, 1.0])
        return goal_pose_pb2.Object(
            name="objects/sha256:abc",
            format=format,
            unit="cm",
            up_axis="y",
            object_to_world=matrix.reshape(-1),
            floor_height=self.floor,
            bounds_min=[-0.3, self.floor, -0.3],
            bounds_max=[0.3, 1.2, 0.3],
            point_count=1500,
            warnings=[goal_pose_pb2.Warning(reason="UNIT_GUESSED", message="taken for cm", remedy="give unit")],
        )

    def UploadObject(self, request_iterator, context):
        requests = list(request_iterator)
        self.uploads = requests
        if b"".join(r.chunk for r in requests).startswith(b"bad"):
            abort(
                context,
                grpc.StatusCode.INVALID_ARGUMENT,
                "the file has no faces",
                "OBJECT_EMPTY",
                remedy="export the mesh again",
                field="chunk",
            )
        return goal_pose_pb2.UploadObjectResponse(object=self._object(requests[0].format))

    def GetObject(self, request, context):
        if request.name != "objects/sha256:abc":
            abort(context, grpc.StatusCode.NOT_FOUND, f"no {request.name}", "OBJECT_NOT_FOUND", remedy="upload again")
        return goal_pose_pb2.GetObjectResponse(object=self._object("obj"))

    def ListReferencePoses(self, request, context):
        while self.slow.is_set() and context.is_active():
            time.sleep(0.01)
        pose = goal_pose_pb2.ReferencePose(
            name="referencePoses/chair_sit",
            title="Sitting on a chair",
            action=skeleton_pb2.ACTION_SIT,
            pose=pose_at(0, 0.5, 0),
            object_points=f4(np.zeros((4, 3))) if request.include_points else b"",
        )
        return goal_pose_pb2.ListReferencePosesResponse(reference_poses=[pose])

    def Synthesize(self, request, context):
        self.requests.append(request)
        if request.reference_pose == "referencePoses/nobody":
            abort(context, grpc.StatusCode.NOT_FOUND, "no reference pose nobody", "REFERENCE_POSE_NOT_FOUND")
        if request.solver == "busy":
            abort(context, grpc.StatusCode.RESOURCE_EXHAUSTED, "the queue is full", "QUEUE_FULL", retry_after=3)
        if request.weights.get("charm"):
            abort(
                context, grpc.StatusCode.INVALID_ARGUMENT, "there is no term charm", "INVALID_ARGUMENT", field="weights"
            )
        root = np.array([0.0, self.floor + 0.5, 0.1], np.float32)
        for iteration in range(3):
            yield goal_pose_pb2.SynthesizeResponse(
                progress=goal_pose_pb2.Progress(
                    stage=1,
                    stage_name="root",
                    iteration=iteration,
                    iteration_count=3,
                    energy=3.0 - iteration,
                    pose=pose_at(*root) if iteration else None,
                )
            )
        aside = np.array([0.5, 0.0, 0.0], np.float32)
        best, *others = [self._goal_pose(request, root + rank * aside) for rank in range(request.count or 1)]
        best.name, best.object, best.floor_height = "goalPoses/sha256:def", request.object, self.floor
        best.alternatives.extend(others)
        if request.HasField("skeleton"):
            best.skeleton.CopyFrom(request.skeleton)
            best.pose.skeleton_id = "sha256:own"
        yield goal_pose_pb2.SynthesizeResponse(goal_pose=best)

    def CreateReferencePose(self, request, context):
        self.created.append(request)
        pose = goal_pose_pb2.ReferencePose(
            name="referencePoses/sha256:own", title=request.title, action=request.action, pose=request.pose
        )
        return goal_pose_pb2.CreateReferencePoseResponse(reference_pose=pose)

    def _goal_pose(self, request, root):
        return goal_pose_pb2.GoalPose(
            pose=pose_at(*root),
            energies={"descriptor": 0.5, "total": 0.5},
            diagnostics={"hip_seat_distance": 0.03, "penetration_depth": 0.01, "floor_distance": 0.0},
            quality=goal_pose_pb2.PoseQuality(
                penetration_depth=0.01,
                penetration_volume=0.002,
                bone_penetrations=[goal_pose_pb2.BonePenetration(bone="hips", depth=0.01, volume=0.002)],
                hip_seat_distance=0.03,
                contacts_met=0.75,
                floor_distance=0.0,
                joint_limit_use=0.5,
            ),
            place=[0, self.floor + 0.4, 0.1],
            reference_pose=request.reference_pose or "referencePoses/chair_sit",
            action=request.action,
            joint_positions=f4(positions_of(root)),
        )


@dataclass
class Character:
    """One session: where it is, where it goes, what it was told."""

    name: str
    floor: float
    root: np.ndarray
    goal: np.ndarray | None = None
    action: int = skeleton_pb2.ACTION_IDLE
    sequence: int = 0
    controls: dict[int, int] = field(default_factory=dict)
    frames: list[motion_pb2.Frame] = field(default_factory=list)
    start: np.ndarray | None = None
    left: int = 0
    events: list[motion_pb2.SessionEvent] = field(default_factory=list)
    reached: bool = False

    def apply(self, control: motion_pb2.ControlInput) -> int:
        if control.control_id in self.controls:
            return self.controls[control.control_id]
        self.controls[control.control_id] = self.sequence + 1
        if control.WhichOneof("input") == "goal":
            self.goal = np.frombuffer(control.goal.pose.root_position, "<f4")
            self.action, self.start, self.left = control.goal.action, self.root, FRAMES_TO_GOAL
        elif control.WhichOneof("input") == "steer":
            self.goal, self.action = None, control.steer.action or skeleton_pb2.ACTION_WALK
            step = np.array([control.steer.velocity_x, 0, control.steer.velocity_z], np.float32) / FRAME_RATE
            self.root = self.root + step
        return self.sequence + 1

    def step(self, encoding: int) -> motion_pb2.Frame:
        self.sequence += 1
        distance = None
        if self.goal is not None:
            self.left = max(0, self.left - 1)
            share = self.left / FRAMES_TO_GOAL
            self.root = (self.start * share + self.goal * (1 - share)).astype(np.float32)
            distance = float(np.linalg.norm(self.root - self.goal))
            if self.left == 0 and not self.reached:
                self.reached = True
                self.events.append(
                    motion_pb2.SessionEvent(type=motion_pb2.EVENT_TYPE_GOAL_REACHED, sequence=self.sequence)
                )
        packed = f4(IDENTITY)
        if encoding == motion_pb2.ROTATION_ENCODING_SNORM16:
            packed = np.rint(IDENTITY * 32767).astype("<i2").tobytes()
        frame = motion_pb2.Frame(
            sequence=self.sequence,
            time=self.sequence / FRAME_RATE,
            root=f4([*self.root, 0, 0, 0, 1]),
            rotations=packed,
            contacts=0b0101,
            action=self.action,
            goal_distance=distance,
        )
        self.frames.append(frame)
        return frame


class Motions(motion_pb2_grpc.MotionServiceServicer):
    """Steps a character only while somebody reads; `break_after` cuts every stream after so many frames."""

    def __init__(self) -> None:
        self.characters: dict[str, Character] = {}
        self.opens: list[motion_pb2.Open] = []
        self.acks: list[int] = []
        self.created: list[motion_pb2.CreateSessionRequest] = []
        self.deleted: list[str] = []
        self.break_after = 0
        self.break_code = grpc.StatusCode.UNAVAILABLE
        self.goodbye = False  # end the stream politely instead of breaking it
        self.forget_controls = False

    def CreateSession(self, request, context):
        self.created.append(request)
        name = f"sessions/{len(self.characters) + 1}"
        place = request.start_placement
        root = np.array([place.x, request.floor_height + 0.9, place.z], np.float32)
        self.characters[name] = Character(name, request.floor_height, root)
        return motion_pb2.CreateSessionResponse(session=self._session(name))

    def _session(self, name: str) -> motion_pb2.Session:
        return motion_pb2.Session(name=name, skeleton_id=SKELETON.id, frame_rate=FRAME_RATE)

    def _find(self, name: str, context) -> Character:
        if name not in self.characters:
            abort(context, grpc.StatusCode.NOT_FOUND, f"no {name}", "SESSION_NOT_FOUND", remedy="create a session")
        return self.characters[name]

    def GetSession(self, request, context):
        self._find(request.name, context)
        return motion_pb2.GetSessionResponse(session=self._session(request.name))

    def DeleteSession(self, request, context):
        self._find(request.name, context)
        self.deleted.append(request.name)
        del self.characters[request.name]
        return motion_pb2.DeleteSessionResponse()

    def Control(self, request, context):
        character = self._find(request.session, context)
        return motion_pb2.ControlResponse(effective_sequence=character.apply(request.control))

    def WatchFrames(self, request, context):
        for message in self._frames(request.open, context, None):
            yield motion_pb2.WatchFramesResponse(message=message)

    def Animate(self, request_iterator, context):
        opening = next(request_iterator).open
        credit = threading.Semaphore(opening.credit)
        character = self._find(opening.session, context)

        def listen() -> None:
            try:
                for request in request_iterator:
                    if request.HasField("ack"):
                        self.acks.append(request.ack.sequence)
                        for _ in range(request.ack.credit):
                            credit.release()
                    elif request.HasField("control") and not self.forget_controls:
                        character.apply(request.control)
            except grpc.RpcError:
                return

        threading.Thread(target=listen, daemon=True).start()
        yield from self._frames(opening, context, credit)

    def _frames(self, opening, context, credit) -> Iterator[motion_pb2.AnimateResponse]:
        self.opens.append(opening)
        character = self._find(opening.session, context)
        known = opening.known_skeleton_id == SKELETON.id
        encoding = opening.rotation_encodings[0]
        yield motion_pb2.AnimateResponse(
            header=motion_pb2.StreamHeader(
                session=character.name,
                skeleton=skeleton_pb2.Skeleton(id=SKELETON.id) if known else SKELETON,
                rotation_encoding=encoding,
                frame_rate=FRAME_RATE,
                first_sequence=opening.after_sequence + 1,
                contact_joints=[0, 1, 1, 2],
                resume_token=f"token-{len(self.opens)}",
                last_control_id=max(character.controls, default=0),
            )
        )
        sent = 0
        replay: Iterable[motion_pb2.Frame] = character.frames[opening.after_sequence :]
        for frame in list(replay):
            yield motion_pb2.AnimateResponse(frame=frame)
        while context.is_active():
            if opening.pacing == motion_pb2.PACING_CREDIT and not credit.acquire(timeout=0.05):
                continue
            if self.break_after and sent >= self.break_after:
                if self.goodbye:
                    return
                context.abort(self.break_code, "connection lost")
            frame = character.step(encoding)
            sent += 1
            yield motion_pb2.AnimateResponse(frame=frame)
            while character.events:
                yield motion_pb2.AnimateResponse(event=character.events.pop(0))
            if opening.pacing != motion_pb2.PACING_CREDIT:
                time.sleep(0.001)


class Skeletons(skeleton_pb2_grpc.SkeletonServiceServicer):
    def GetSkeleton(self, request, context):
        if request.skeleton not in ("", "default", SKELETON.id):
            abort(context, grpc.StatusCode.NOT_FOUND, f"no skeleton {request.skeleton}", "SKELETON_NOT_FOUND")
        return skeleton_pb2.GetSkeletonResponse(skeleton=SKELETON, body=BODY)


class Servers(server_pb2_grpc.ServerServiceServicer):
    def GetServerInfo(self, request, context):
        return server_pb2.GetServerInfoResponse(version="0.0", services=["motion"], limits={"max_sessions": 9})


@dataclass
class Fake:
    """A running pair and what it saw."""

    address: str
    other_address: str  # of another replica, so to speak
    goal_poses: GoalPoses
    motions: Motions


@contextmanager
def fake_services() -> Iterator[Fake]:
    server = grpc.server(futures.ThreadPoolExecutor(16))
    goal_poses, motions = GoalPoses(), Motions()
    goal_pose_pb2_grpc.add_GoalPoseServiceServicer_to_server(goal_poses, server)
    motion_pb2_grpc.add_MotionServiceServicer_to_server(motions, server)
    skeleton_pb2_grpc.add_SkeletonServiceServicer_to_server(Skeletons(), server)
    server_pb2_grpc.add_ServerServiceServicer_to_server(Servers(), server)
    ports = [server.add_insecure_port("127.0.0.1:0") for _ in range(2)]
    server.start()
    try:
        yield Fake(*(f"127.0.0.1:{port}" for port in ports), goal_poses, motions)
    finally:
        server.stop(None)
