"""Settings of the motion server."""

from pydantic import Field
from roam_serving.settings import ServerSettings


class MotionSettings(ServerSettings):
    """What `python -m roam_motion.app` takes besides the addresses."""

    max_sessions: int = Field(256, ge=1, description="most sessions alive at once")
    caller_sessions: int = Field(0, ge=0, description="most sessions of one API key or address; 0: no limit")
    controls_per_second: float = Field(120.0, gt=0, description="controls that one session takes in the long run [1/s]")
    control_bytes: int = Field(
        1 << 20, ge=1 << 16, description="most that is kept of one session's controls, its goals above all [bytes]"
    )
    caller_bytes: int = Field(
        16 << 20, ge=1 << 16, description="the same of all sessions of one API key or address [bytes]"
    )
    idle_timeout: float = Field(60.0, gt=0, description="a session without a client is kept this long by default [s]")
    max_idle_timeout: float = Field(3600.0, gt=0, description="longest idle timeout a client may ask for [s]")
    ring_frames: int = Field(900, ge=2, description="frames kept per session, for clients that come back")
    burst_frames: int = Field(60, ge=1, description="how far a BURST stream is computed ahead of its reader [frames]")
    ack_window: int = Field(12, ge=4, description="unacknowledged frames that a client which acknowledges may have")
    motion_weights: str = Field("", description="weights of the network; empty: the shipped ones")
    step_process: bool = Field(True, description="compute frames in a process of their own, beside the one that sends")
    goal_tolerance: float = Field(0.05, gt=0, description="mean joint distance at which a goal counts as reached [m]")
    session_store: str = Field(
        "memory",
        pattern=r"^(memory|(redis|rediss|unix)://.+)$",
        description="memory, or redis://… where several replicas share sessions",
    )
    session_header: bool = Field(False, description="take a new session's id from x-roam-session, set by a gateway")
    session_lease: float = Field(0.5, gt=0, description="a replica that is silent for so long loses its sessions [s]")
    snapshot_frames: int = Field(15, ge=1, description="frames between two snapshots of a session")
    history_frames: int = Field(240, ge=1, description="how far back a session can be resumed elsewhere [frames]")
