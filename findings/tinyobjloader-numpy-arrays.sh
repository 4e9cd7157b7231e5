#!/bin/sh -e
# Most expect: tinyobjloader's numpy_vertices() and numpy_indices() are the fast way to the numbers that .vertices holds.
# True: in 2.0.0rc13 (numpy 2.4.6, Python 3.11) every entry of the array they return is the first value, without an
#       error; the list accessors beside them are right.
# Matters here: an OBJ reader on the numpy accessors turns every chair into one point; we read the lists.
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q "tinyobjloader==2.0.0rc13" "numpy==2.4.6"
"$dir/venv/bin/python" - <<'PY'
from importlib.metadata import version

import tinyobjloader

config = tinyobjloader.ObjReaderConfig()
config.triangulate = False
reader = tinyobjloader.ObjReader()
assert reader.ParseFromString("v 1 2 3\nv 4 5 6\nv 7 8 10\nf 1 2 3\n", "", config)
lists, arrays = list(reader.GetAttrib().vertices), reader.GetAttrib().numpy_vertices().tolist()
print("tinyobjloader", version("tinyobjloader"), "numpy", version("numpy"))
print("vertices:        ", lists)
print("numpy_vertices():", arrays)
assert lists == [1, 2, 3, 4, 5, 6, 7, 8, 10]
assert arrays == [1.0] * 9, "changed: the numpy accessor is right now"
PY
