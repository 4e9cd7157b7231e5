"""The ROAM protocol as generated Python code: `from roam.v1 import motion_pb2`. Made by `scripts/stubs`."""
