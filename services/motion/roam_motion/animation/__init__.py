"""The moving body: kinematics, features, blending, foot contacts, collision."""
