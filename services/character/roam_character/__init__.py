"""The body, shared by both services: rotations, skeletons, kinematics, clips, retargeting and file formats."""
