#!/usr/bin/env python3
"""Reads CAD files with nurbskin and with OpenCascade and prints what both find.

    cad.py FILE...          [--tool PATH] [--markdown]
    cad.py --make FOLDER    [--tool PATH] [--markdown]     makes samples with OpenCascade first, and reads those
    cad.py ... --again FOLDER    has nurbskin convert every file to STEP and IGES there, and reads those, too

A row has the number of faces, the unit, the area and the box (all in millimetres) as OpenCascade finds them, and how far
ours are from them: the area relative to itself, the box relative to its diagonal. OpenCascade integrates the area
adaptively and searches the exact box: its defaults are off by percents. The exit status is 1 if a number of faces differs,
an area by more than 1e-5 (1e-4 of what nurbskin wrote), a box by more than 1e-6, or anything in a file was not understood.

Needs numpy and cadquery-ocp. The tool is looked for in target/release, then in PATH.
"""
import argparse
import contextlib
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps
from OCP.IFSelect import IFSelect_RetDone
from OCP.IGESControl import IGESControl_Controller, IGESControl_Reader, IGESControl_Writer
from OCP.Interface import Interface_Static
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Reader, STEPControl_Writer
from OCP.TopAbs import TopAbs_FACE
from OCP.TopExp import TopExp_Explorer

AREA, BOX = 1e-5, 1e-6
# Of what is B-splines only, as nurbskin writes it, OpenCascade integrates the area less well.
AREA_AGAIN = 1e-4
MILLIMETRES = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "ft": 304.8}


def static(name):
    """Static methods have a suffix in some versions of the bindings."""
    return lambda owner: getattr(owner, name + "_s", None) or getattr(owner, name)


@contextlib.contextmanager
def silence():
    """What OpenCascade prints, to nowhere."""
    sys.stdout.flush()
    kept = os.dup(1)
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def read(path):
    """The shape of a file as OpenCascade reads it, in millimetres."""
    step = path.suffix.lower() in (".step", ".stp")
    reader = STEPControl_Reader() if step else IGESControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_RetDone:
        raise ValueError("OpenCascade does not read it")
    reader.TransferRoots()
    return reader.OneShape()


def box_of(shape):
    """Its exact box: the lowest and the highest corner."""
    box = Bnd_Box()
    static("AddOptimal")(BRepBndLib)(shape, box, False, False)
    low, high = box.CornerMin(), box.CornerMax()
    gap = box.GetGap()
    return np.array([[p.X(), p.Y(), p.Z()] for p in (low, high)]) + [[gap], [-gap]]


def theirs(path):
    """Faces, area, box: as OpenCascade finds them, in millimetres."""
    shape = read(path)
    faces, area = 0, 0.0
    explorer = TopExp_Explorer(shape, TopAbs_FACE)
    while explorer.More():
        properties = GProp_GProps()
        static("SurfaceProperties")(BRepGProp)(explorer.Current(), properties, 1e-9)
        faces, area = faces + 1, area + abs(properties.Mass())
        explorer.Next()
    return faces, area, box_of(shape)


def tool_of(options):
    """The nurbskin program: what is named, else a release build, else that of the PATH."""
    release = pathlib.Path(__file__).resolve().parent.parent / "target/release/nurbskin"
    return options.tool or (str(release) if release.exists() else shutil.which("nurbskin"))


def ours(tool, path):
    """The same from `nurbskin info`, with the unit of the file, what was not understood, and warnings."""
    done = subprocess.run([tool, "info", "--json", str(path)], capture_output=True, text=True)
    if done.returncode != 0:
        raise ValueError(done.stderr.strip().splitlines()[-1])
    file = json.loads(done.stdout)["files"][0]
    unit = MILLIMETRES[file["unit"]]
    box = np.array(file["bounding_box"] or np.full((2, 3), math.nan)) * unit
    return file["faces"], file["area"] * unit**2, box, file["unit"], file["unread"], file["warnings"]


def row(tool, path, most):
    """A line of the table, whether it is right, and what to say beside it."""
    try:
        with silence():
            faces, area, box = theirs(path)
    except Exception as error:  # the bindings raise what they like
        return [path.name, "-", "-", "-", "-", "-", "-"], False, [f"OpenCascade: {error}"]
    size = np.linalg.norm(box[1] - box[0])
    cells = [path.name, str(faces), "", "", f"{area:.6g}", "", ""]
    try:
        found, mine, corners, unit, unread, notes = ours(tool, path)
    except ValueError as error:
        return cells, False, [f"nurbskin: {error}"]
    off_area, off_box = abs(mine - area) / area, np.abs(corners - box).max() / size
    cells[2:] = [str(found), unit, f"{area:.6g}", f"{off_area:.0e}", f"{off_box:.0e}"]
    notes = [f"not understood: {unread}"] * bool(unread) + notes
    return cells, found == faces and off_area <= most and off_box <= BOX and not unread, notes


def table(tool, paths, written, markdown):
    head = ["file", "faces", "ours", "unit", "area / mm2", "area differs", "box differs"]
    rows = [row(tool, path, AREA) for path in paths] + [row(tool, path, AREA_AGAIN) for path in written]
    cells = [head] + [cells for cells, _, _ in rows]
    widths = [max(len(line[k]) for line in cells) for k in range(len(head))]
    rule = "|" + "|".join("-" * (w + 1) + (":" if k else "-") for k, w in enumerate(widths)) + "|"
    for at, line in enumerate(cells):
        padded = [c.ljust(w) if k == 0 else c.rjust(w) for k, (c, w) in enumerate(zip(line, widths))]
        good = at == 0 or rows[at - 1][1]
        print("| " + " | ".join(padded) + " |" if markdown else "  ".join(padded) + ("" if good else "  <--"))
        if markdown and at == 0:
            print(rule)
    for (line, good, notes) in rows:
        for note in notes if not good or not markdown else []:
            print(f"{line[0]}: {note}", file=sys.stderr)
    wrong = sum(not good for _, good, _ in rows)
    print(f"{len(rows)} files, {wrong} of them not as OpenCascade has them", file=sys.stderr)
    return wrong == 0


# Samples


def shapes():
    """Names and makers of shapes."""
    from OCP import BRepAlgoAPI as boolean
    from OCP import BRepBuilderAPI as build
    from OCP import BRepPrimAPI as solid
    from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
    from OCP.BRepOffsetAPI import BRepOffsetAPI_MakePipe, BRepOffsetAPI_MakeThickSolid, BRepOffsetAPI_ThruSections
    from OCP.Geom import Geom_BezierCurve
    from OCP.gp import gp_Ax1, gp_Ax2, gp_Circ, gp_Dir, gp_Elips, gp_Pnt, gp_Trsf, gp_Vec
    from OCP.TopAbs import TopAbs_EDGE

    try:
        from OCP.TopTools import TopTools_ListOfShape as ListOfShape
    except ImportError:
        from OCP.collections import List_TopoDS_Shape as ListOfShape
    try:
        from OCP.TColgp import TColgp_Array1OfPnt as Points
    except ImportError:
        from OCP.collections import Array1_gp_Pnt as Points
    from OCP.TopoDS import TopoDS

    def as_edge(shape):
        return static("Edge")(TopoDS)(shape)

    def parts(shape, kind):
        found, explorer = [], TopExp_Explorer(shape, kind)
        while explorer.More():
            if not any(explorer.Current().IsSame(s) for s in found):
                found.append(explorer.Current())
            explorer.Next()
        return found

    def at(x, y, z, way=(0, 0, 1)):
        return gp_Ax2(gp_Pnt(x, y, z), gp_Dir(*way))

    def box(a=10, b=20, c=30, x=0, y=0, z=0):
        return solid.BRepPrimAPI_MakeBox(gp_Pnt(x, y, z), a, b, c).Shape()

    def cylinder(radius, height, axes=None):
        return solid.BRepPrimAPI_MakeCylinder(axes or at(0, 0, 0), radius, height).Shape()

    def ball(radius):
        return solid.BRepPrimAPI_MakeSphere(radius).Shape()

    def torus(major=10, minor=3):
        return solid.BRepPrimAPI_MakeTorus(major, minor).Shape()

    def cone():
        return solid.BRepPrimAPI_MakeCone(5, 0, 10).Shape()

    def cut(a, b):
        return boolean.BRepAlgoAPI_Cut(a, b).Shape()

    def filleted(shape, radius):
        made = BRepFilletAPI_MakeFillet(shape)
        for edge in parts(shape, TopAbs_EDGE):
            made.Add(radius, as_edge(edge))
        return made.Shape()

    def edge(curve, *ends):
        return build.BRepBuilderAPI_MakeEdge(curve, *ends).Edge()

    def wire(*edges):
        made = build.BRepBuilderAPI_MakeWire()
        for each in edges:
            made.Add(each)
        return made.Wire()

    def spline(*points):
        poles = Points(1, len(points))
        for k, p in enumerate(points):
            poles.SetValue(k + 1, gp_Pnt(*p))
        return Geom_BezierCurve(poles)

    def profile():
        return edge(spline((5, 0, 0), (9, 0, 3), (3, 0, 6), (8, 0, 9)))

    def revolved(angle):
        return solid.BRepPrimAPI_MakeRevol(profile(), gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), angle).Shape()

    def lofted():
        made = BRepOffsetAPI_ThruSections(True, False)
        made.AddWire(wire(edge(gp_Circ(at(0, 0, 0), 5))))
        made.AddWire(wire(edge(gp_Elips(at(1, 0, 5), 4, 2))))
        made.AddWire(wire(edge(gp_Circ(at(0, 0, 12), 3))))
        return made.Shape()

    def shelled():
        shape, open_faces = drilled(), ListOfShape()
        planes = parts(shape, TopAbs_FACE)
        highest = max(planes, key=lambda f: centre(f)[2])
        open_faces.Append(highest)
        made = BRepOffsetAPI_MakeThickSolid()
        made.MakeThickSolidByJoin(shape, open_faces, -0.8, 1e-6)
        return made.Shape()

    def centre(face):
        properties = GProp_GProps()
        static("SurfaceProperties")(BRepGProp)(face, properties)
        p = properties.CentreOfMass()
        return p.X(), p.Y(), p.Z()

    def pipe():
        path = wire(edge(spline((0, 0, 0), (3, 0, 5), (2, 6, 10), (0, 0, 15))))
        disc = build.BRepBuilderAPI_MakeFace(wire(edge(gp_Circ(at(0, 0, 0, (3, 0, 5)), 1)))).Face()
        return BRepOffsetAPI_MakePipe(path, disc).Shape()

    def moved(shape, set_up):
        way = gp_Trsf()
        set_up(way)
        return build.BRepBuilderAPI_Transform(shape, way, True).Shape()

    def drilled():
        across = cylinder(2, 40, at(-5, 10, 5, (1, 0, 0)))
        return cut(cut(box(20, 20, 10), cylinder(3, 20, at(10, 10, -5))), across)

    mirror = gp_Ax2(gp_Pnt(1, 2, 3), gp_Dir(1, 2, 2))
    yield "box_filleted", lambda: filleted(box(), 2)
    yield "box_shelled", shelled
    yield "box_drilled", drilled
    yield "lofted", lofted
    yield "revolved", lambda: revolved(2 * math.pi)
    yield "revolved_part", lambda: revolved(4.0)
    yield "pipe", pipe
    yield "ball", lambda: ball(7)
    yield "ball_drilled", lambda: cut(ball(10), cylinder(3, 40, at(1, 0.5, -20)))
    yield "ball_drilled_across", lambda: cut(ball(10), cylinder(3, 40, at(-20, 0, 0, (1, 0, 0))))
    yield "ball_half", lambda: cut(ball(10), box(30, 30, 30, 0, -15, -15))
    yield "ball_cut_beside_poles", lambda: cut(ball(10), box(30, 30, 60, 0.01, -15, -30))
    yield "cone_drilled", lambda: cut(cone(), cylinder(1, 40, at(0, -20, 3, (0, 1, 0))))
    yield "cone_cut_through_tip", lambda: cut(cone(), box(20, 20, 20, 0, -10, -5))
    yield "torus", torus
    yield "torus_cut", lambda: cut(torus(), box(30, 30, 30, 1, 2, -1))
    yield "torus_drilled", lambda: cut(torus(), cylinder(1, 40, at(-10, 2, 0)))
    yield "torus_crossed", lambda: cut(cut(torus(), box(40, 1, 40, -20, 2, -20)), box(40, 40, 1, -20, -20, 0))
    yield "torus_halved", lambda: cut(torus(), box(40, 40, 30, -20, -20, 0.5))
    yield "cylinders_crossed", lambda: boolean.BRepAlgoAPI_Fuse(
        cylinder(5, 40, at(0, 0, -20)), cylinder(4, 40, at(0, -20, 0, (0, 1, 0)))
    ).Shape()
    yield "drilled_mirrored", lambda: moved(drilled(), lambda t: t.SetMirror(mirror))
    yield "drilled_scaled", lambda: moved(drilled(), lambda t: t.SetScale(gp_Pnt(1, 2, 3), 0.3))
    yield "filleted_mirrored", lambda: moved(filleted(box(), 2), lambda t: t.SetMirror(mirror))
    yield "drilled_far", lambda: moved(drilled(), lambda t: t.SetTranslation(gp_Vec(1e5, 2e5, -3e5)))


def write_step(shape, path, unit="MM", schema="AP214IS", pcurves=1):
    static("SetCVal")(Interface_Static)("write.step.schema", schema)
    static("SetCVal")(Interface_Static)("write.step.unit", unit)
    static("SetIVal")(Interface_Static)("write.surfacecurve.mode", pcurves)
    writer = STEPControl_Writer()
    writer.Transfer(shape, STEPControl_AsIs)
    writer.Write(str(path))


def write_iges(shape, path, brep):
    writer = IGESControl_Writer("MM", brep)
    writer.AddShape(shape)
    writer.ComputeModel()
    writer.Write(str(path))


def placed_copies(text):
    """The part of a STEP file three times: as it is, moved, and turned, by transformation operators.

    Neither scaled nor mirrored: OpenCascade 8.0 applies the inverse of a scale, and turns where it should mirror.
    """
    part = re.search(r"#(\d+) *= *ADVANCED_BREP_SHAPE_REPRESENTATION\('[^']*',\(#(\d+),[^)]*\),#(\d+)\)", text)
    owner = re.search(r"SHAPE_DEFINITION_REPRESENTATION\((#\d+),#" + part[1] + r"\)", text)
    frame, first = part[2], 1 + max(int(k) for k in re.findall(r"#(\d+) *=", text))
    lines, items = [], []

    def add(what):
        lines.append(f"#{first + len(lines)}={what};")
        return f"#{first + len(lines) - 1}"

    source = add(f"REPRESENTATION_MAP(#{frame},#{part[1]})")
    upright, turned = ("1.,0.,0.", "0.,1.,0."), ("0.,1.,0.", "-1.,0.,0.")
    for origin, axes in [("0.,0.,0.", upright), ("90.,0.,5.", upright), ("0.,-90.,0.", turned)]:
        axes = [add(f"DIRECTION('',({d}))") for d in (*axes, "0.,0.,1.")]
        point = add(f"CARTESIAN_POINT('',({origin}))")
        operator = f"CARTESIAN_TRANSFORMATION_OPERATOR_3D('','',$,{axes[0]},{axes[1]},{point},1.,{axes[2]})"
        items.append(add(f"MAPPED_ITEM('',{source},{add(operator)})"))
    whole = add(f"SHAPE_REPRESENTATION('',({','.join(items)}),#{part[3]})")
    text = text.replace(owner[0], f"SHAPE_DEFINITION_REPRESENTATION({owner[1]},{whole})")
    at = text.rindex("ENDSEC;")
    return text[:at] + "\n".join(lines) + "\n" + text[at:]


def make(folder):
    folder.mkdir(parents=True, exist_ok=True)
    static("Init")(IGESControl_Controller)()
    schemas = ["AP214IS", "AP203", "AP242DIS"]
    for k, (name, shape) in enumerate(shapes()):
        shape = shape()
        write_step(shape, folder / f"{name}.step", schema=schemas[k % 3])
        # Of the mirrored fillets that it reads back one by one, OpenCascade's box is too wide by 1 %.
        if name != "filleted_mirrored":
            write_iges(shape, folder / f"{name}_faces.igs", 0)
        write_iges(shape, folder / f"{name}_brep.igs", 1)
        if name in ("box_drilled", "ball_drilled"):
            write_step(shape, folder / f"{name}_inch.step", unit="INCH")
            plain = (folder / f"{name}.step").read_text()
            (folder / f"{name}_placed_copies.step").write_text(placed_copies(plain))
    return sorted(p for p in folder.iterdir() if p.suffix in (".step", ".igs"))


def again(tool, paths, folder):
    """The files as nurbskin writes them."""
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for path in paths:
        both = [folder / f"{path.name.replace('.', '_')}.{end}" for end in ("step", "igs")]
        names = [word for each in both for word in ("-o", str(each))]
        subprocess.run([tool, "convert", str(path), *names], capture_output=True, check=True)
        made += both
    return made


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=pathlib.Path)
    parser.add_argument("--make", type=pathlib.Path, metavar="FOLDER")
    parser.add_argument("--again", type=pathlib.Path, metavar="FOLDER")
    parser.add_argument("--tool", help="the nurbskin program")
    parser.add_argument("--markdown", action="store_true")
    options = parser.parse_args()
    tool = tool_of(options)
    files = options.files
    if options.make:
        with silence():
            files = files + make(options.make)
    if not tool or not files:
        parser.error("no nurbskin program: give --tool" if files else "no files")
    written = again(tool, files, options.again) if options.again else []
    sys.exit(0 if table(tool, files, written, options.markdown) else 1)


if __name__ == "__main__":
    main()
