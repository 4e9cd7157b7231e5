#!/bin/sh -e
# Most expect: meshoptimizer.decode_index_buffer(count, 2, data) returns `count` indices.
# True: in the wheel 0.2.30a0 it returns `count` numbers of 32 bits of which the first half holds two 16-bit indices
#       each and the rest is zero; with 4 instead of 2 the same data decode rightly.
# Matters here: glTF files packed by gltfpack have 16-bit index views (byteStride 2); read as the file says, every mesh is
#       torn. We always decode to 32 bits and narrow afterwards.
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q "meshoptimizer==0.2.30a0" "numpy==2.4.6"
"$dir/venv/bin/python" - <<'PY'
from importlib.metadata import version

import meshoptimizer
import numpy as np

triangles = np.array([0, 1, 2, 2, 1, 3], np.uint32)
packed = bytes(meshoptimizer.encode_index_buffer(triangles, len(triangles), 4))
two = meshoptimizer.decode_index_buffer(len(triangles), 2, packed).tolist()
four = meshoptimizer.decode_index_buffer(len(triangles), 4, packed).tolist()
print("meshoptimizer", version("meshoptimizer"))
print("asked for 4 bytes:", four)
print("asked for 2 bytes:", two)
rows = lambda numbers: sorted(tuple(sorted(numbers[k : k + 3])) for k in (0, 3))
assert rows(four) == [(0, 1, 2), (1, 2, 3)]
assert two[3:] == [0, 0, 0], "changed: 16-bit indices are unpacked now"
assert np.array(two[:3], np.uint32).view(np.uint16).tolist() == four
PY
