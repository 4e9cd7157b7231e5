"""Settings of the goal pose server."""

from pydantic import Field
from roam_serving.settings import ServerSettings


class GoalPoseSettings(ServerSettings):
    """What `python -m roam_goalpose.app` takes besides the addresses."""

    field_weights: str = Field("", description="weights of the descriptor field; empty: the shipped ones")
    references: str = Field("", description="folder of reference pairs; empty: the shipped ones")
    isolate_uploads: bool = Field(True, description="read files in child processes with limits, not in the server")
    object_cache: int = Field(64, ge=1, description="uploaded objects kept in memory")
    result_cache: int = Field(1024, ge=1, description="answers kept in memory")
    workers: int = Field(0, ge=0, description="processes that compute goal poses; 0: a thread of the server")
    worker_lanes: int = Field(4, ge=1, description="goal poses that share the optimiser's steps in one process")
    reference_cache: int = Field(64, ge=1, description="uploaded reference poses kept in memory")
    max_count: int = Field(16, ge=1, description="most poses that a request may ask for")
    queue_limit: int = Field(16, ge=1, description="goal poses waiting or running before new ones are refused")
    upload_limit: int = Field(8, ge=1, description="uploads waiting or being read before new ones are refused")
    max_inline_points: int = Field(200_000, ge=1, description="most points in a request that brings its own")
    max_restarts: int = Field(64, ge=1, description="most initial headings a request may ask for")
