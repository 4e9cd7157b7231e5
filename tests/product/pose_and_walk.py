"""Prints what the torch of this interpreter makes of a chair: a goal pose, and a character that walks for a second."""

import json
import sys
from pathlib import Path

import numpy as np
import torch
from roam_goalpose.objects import load_shape
from roam_goalpose.synthesis import GoalPoseRequest, Synthesizer
from roam_motion.animator import Animator, Steer
from roam_serving.shipped import OBJECTS, WEIGHTS

torch.set_num_threads(1)
shape = load_shape((Path(OBJECTS) / "chair.glb").read_bytes(), "glb")
result = Synthesizer.load().synthesize(shape, GoalPoseRequest(reference="chair_sit"))
animator = Animator.load(WEIGHTS / "motion.safetensors")
state = animator.start((0.0, 0.0), 0.0, 0)
for _ in range(30):
    ((state, frame),) = animator.step([state], [Steer(np.array([0.0, 1.0], np.float32))])
answer = {
    "torch": torch.__version__,
    "goal_pose": np.asarray(result.pose.root_position).tolist() + np.asarray(result.pose.rotations).ravel().tolist(),
    "frame": np.asarray(frame.root_position).tolist() + np.asarray(frame.rotations).ravel().tolist(),
}
json.dump(answer, sys.stdout)
