"""The box chair in formats that say their own unit and axes, written by hand or by their libraries."""

import io
import zipfile

import numpy as np
import trimesh
from box_furniture import box_chair

CHAIR = box_chair()
STANDING = np.asarray(CHAIR.vertices)  # [m], +Y up, facing +Z
LYING = STANDING[:, [0, 2, 1]] * [1, -1, 1]  # the same in Z-up axes: x, -z, y
FACES = np.asarray(CHAIR.faces)


def _words(values, line="{:.6f} {:.6f} {:.6f}", join=" "):
    return join.join(line.format(*row) for row in values)


def usda(up="Z", metres=0.01):
    """A mesh below a moved Xform."""
    points = (LYING if up == "Z" else STANDING) / metres
    head = f'#usda 1.0\n(\n    metersPerUnit = {metres}\n    upAxis = "{up}"\n    defaultPrim = "chair"\n)\n'
    body = 'def Xform "chair"\n{\n    double3 xformOp:translate = (1, 0, 0)\n'
    body += '    uniform token[] xformOpOrder = ["xformOp:translate"]\n    def Mesh "seat"\n    {\n'
    body += f"        int[] faceVertexCounts = [{', '.join('3' for _ in FACES)}]\n"
    body += f"        int[] faceVertexIndices = [{', '.join(str(k) for k in FACES.ravel())}]\n"
    body += f"        point3f[] points = [{_words(points - [1, 0, 0], '({:.6f}, {:.6f}, {:.6f})', ', ')}]\n    }}\n}}\n"
    return (head + body).encode()


def usdz():
    """The same in a package, as the specification wants it: stored, 64-byte aligned."""
    packed, layer = io.BytesIO(), usda()
    with zipfile.ZipFile(packed, "w") as archive:
        info = zipfile.ZipInfo("chair.usda")
        info.extra = b"\x86\x19" + (64 - 30 - 10 - 4).to_bytes(2, "little") + b"\0" * (64 - 30 - 10 - 4)
        archive.writestr(info, layer)
    return packed.getvalue()


def dae(up="Z_UP", metres=0.01):
    """COLLADA 1.4.1 with a scaled node."""
    points = (LYING if up == "Z_UP" else STANDING) / metres / 2
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><contributor/><created>2026-01-01T00:00:00</created><modified>2026-01-01T00:00:00</modified>
<unit name="centimeter" meter="{metres}"/><up_axis>{up}</up_axis></asset>
<library_geometries><geometry id="g" name="seat"><mesh><source id="p">
<float_array id="pa" count="{points.size}">{_words(points)}</float_array>
<technique_common><accessor source="#pa" count="{len(points)}" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="{len(FACES)}"><input semantic="VERTEX" source="#v" offset="0"/>
<p>{_words(FACES, "{} {} {}")}</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><scale>2 2 2</scale><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>""".encode()


def threemf(unit="millimeter", metres=0.001):
    """One object and a build item that moves it."""
    points = LYING / metres
    vertices = "".join(f'<vertex x="{x:.5f}" y="{y:.5f}" z="{z:.5f}"/>' for x, y, z in points)
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in FACES)
    model = f"""<?xml version="1.0"?><model unit="{unit}"
xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources><object id="1" type="model"><mesh>
<vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh></object></resources>
<build><item objectid="1" transform="1 0 0 0 1 0 0 0 1 0 0 0"/></build></model>"""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("3D/3dmodel.model", model)
    return packed.getvalue()


def fbx(up=2, centimetres=1.0):
    """FBX 7.4 as text: `up` 1 is Y, 2 is Z; `centimetres` in a unit."""
    points = (LYING if up == 2 else STANDING) * 100 / centimetres
    corners = ",".join(f"{a},{b},{-c - 1}" for a, b, c in FACES)
    axes = ((0, 1), (1, 1), (2, 1)) if up == 1 else ((0, 1), (2, 1), (1, -1))
    (right, right_sign), (_, up_sign), (front, front_sign) = axes
    settings = "".join(
        f'P: "{name}", "int", "Integer", "",{value}\n'
        for name, value in (
            ("UpAxis", up), ("UpAxisSign", up_sign), ("FrontAxis", front), ("FrontAxisSign", front_sign),
            ("CoordAxis", right), ("CoordAxisSign", right_sign),
        )
    )  # fmt: skip
    return f"""; FBX 7.4.0 project file
FBXHeaderExtension:  {{
FBXHeaderVersion: 1003
FBXVersion: 7400
}}
GlobalSettings:  {{
Version: 1000
Properties70:  {{
{settings}P: "UnitScaleFactor", "double", "Number", "",{centimetres}
}}
}}
Objects:  {{
Geometry: 11, "Geometry::seat", "Mesh" {{
Vertices: *{points.size} {{
a: {_words(points, "{:.6f},{:.6f},{:.6f}", ",")}
}}
PolygonVertexIndex: *{FACES.size} {{
a: {corners}
}}
GeometryVersion: 124
}}
Model: 12, "Model::chair", "Mesh" {{
Version: 232
Properties70:  {{
}}
}}
}}
Connections:  {{
C: "OO",12,0
C: "OO",11,12
}}
""".encode()


def cloud(count=6000):
    """Points `[N, 3]` of the chair, Z up."""
    return trimesh.sample.sample_surface(trimesh.Trimesh(LYING, FACES, process=False), count, seed=2)[0]


def las(compressed=False, shift=(0.0, 0.0, 0.0)):
    """LAS 1.2 (or LAZ) in metres."""
    import laspy

    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales, header.offsets = [0.0001] * 3, np.array(shift)
    file = laspy.LasData(header)
    file.x, file.y, file.z = (cloud() + shift).T
    stream = io.BytesIO()
    file.write(stream, do_compress=compressed)
    return stream.getvalue()


def e57(folder):
    """One scan of an E57 file, written to a file in `folder`."""
    import pye57

    path = folder / "scan.e57"
    file = pye57.E57(str(path), mode="w")
    x, y, z = cloud().T
    file.write_scan_raw({"cartesianX": x.copy(), "cartesianY": y.copy(), "cartesianZ": z.copy()})
    file.close()
    return path.read_bytes()
