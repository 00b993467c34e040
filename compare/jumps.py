#!/usr/bin/env python3
"""Measures the angles between normals across the edges of STEP files with OpenCascade, beside our figures.

    jumps.py FILE...        [--tool PATH] [--samples N] [--markdown]

OpenCascade evaluates the normals of both faces of each edge at the same places, through the p-curves of the file. An edge is
smooth where most of its samples turn by less than 5 degrees, as in `nurbskin check`. A row has the number of smooth edges and of
others, and of the smooth ones, by length, the angles below which 95 % and 99 % are, the largest, the share over 0.1 and 0.5
degrees, and our certified bound. The exit status is 1 if OpenCascade finds a larger angle than the bound, or other smooth edges.

Needs numpy and cadquery-ocp. The tool is looked for in target/release, then in PATH.
"""
import argparse
import json
import math
import os
import pathlib
import shutil
import subprocess
import sys

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Curve2d, BRepAdaptor_Surface
from OCP.BRepLProp import BRepLProp_SLProps
from OCP.IFSelect import IFSelect_RetDone
from OCP.STEPControl import STEPControl_Reader
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS

try:
    from OCP.TopTools import TopTools_IndexedDataMapOfShapeListOfShape as FacesOfEdges
except ImportError:  # OpenCascade 8
    from OCP.collections import (
        IndexedDataMap_TopoDS_Shape_List_TopoDS_Shape_TopTools_ShapeMapHasher as FacesOfEdges,
    )

# Degrees.
SMOOTH = 5.0
# Of the bound: its own slack is 5 %, the angle of two normals is known to the root of the rounding.
SLACK, ROUNDING = 1e-6, 1e-5


def static(owner, name):
    """Static methods have a suffix in some versions of the bindings."""
    return getattr(owner, name + "_s", None) or getattr(owner, name)


def shape_of(path):
    reader = STEPControl_Reader()
    if reader.ReadFile(path) != IFSelect_RetDone:
        sys.exit(f"{path}: OpenCascade cannot read it")
    reader.TransferRoots()
    return reader.OneShape()


def normal(face, surface, curve, t):
    """The unit normal of a face at a parameter of an edge; None where there is none."""
    place = curve.Value(t)
    properties = BRepLProp_SLProps(surface, place.X(), place.Y(), 1, 1e-12)
    if not properties.IsNormalDefined():
        return None
    n = properties.Normal()
    n = np.array([n.X(), n.Y(), n.Z()])
    return -n if face.Orientation() == TopAbs_REVERSED else n


def edges_of(shape, samples):
    """For each edge between two faces, the angles at its samples in degrees, and its length."""
    faces_of = FacesOfEdges()
    static(TopExp, "MapShapesAndAncestors")(shape, TopAbs_EDGE, TopAbs_FACE, faces_of)
    to_edge, to_face = static(TopoDS, "Edge"), static(TopoDS, "Face")
    for k in range(1, faces_of.Extent() + 1):
        faces = [to_face(face) for face in faces_of.FindFromIndex(k)]
        if len(faces) != 2:
            continue
        edge = to_edge(faces_of.FindKey(k))
        if static(BRep_Tool, "Degenerated")(edge):
            continue
        curve = BRepAdaptor_Curve(edge)
        first, last = curve.FirstParameter(), curve.LastParameter()
        sides = [(f, BRepAdaptor_Surface(f), BRepAdaptor_Curve2d(edge, f)) for f in faces]
        angles, places = [], []
        for t in np.linspace(first, last, samples):
            p = curve.Value(t)
            places.append([p.X(), p.Y(), p.Z()])
            a, b = (normal(*side, t) for side in sides)
            if a is not None and b is not None:
                angles.append(math.degrees(math.atan2(np.linalg.norm(np.cross(a, b)), a @ b)))
        length = np.linalg.norm(np.diff(places, axis=0), axis=1).sum()
        yield np.array(angles), length


def quantile(angles, weights, share):
    order = np.argsort(angles)
    reach = np.cumsum(weights[order])
    return angles[order][np.searchsorted(reach, share * reach[-1])]


def ours(tool, path):
    ran = subprocess.run([tool, "check", "--json", path], capture_output=True, text=True)
    return json.loads(ran.stdout)["normal_jump"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("files", nargs="+")
    parser.add_argument("--tool")
    parser.add_argument("--samples", type=int, default=101, help="places on each edge (default 101)")
    parser.add_argument("--markdown", action="store_true")
    options = parser.parse_args()
    release = pathlib.Path(__file__).resolve().parent.parent / "target/release/nurbskin"
    tool = options.tool or (str(release) if release.exists() else shutil.which("nurbskin"))
    if not tool:
        sys.exit("no nurbskin: build it, or say --tool")
    columns = ["file", "smooth", "other", "p95", "p99", "largest", "> 0.1", "> 0.5", "our bound"]
    if options.markdown:
        print("| " + " | ".join(columns) + " |\n|" + "---|" * len(columns))
    else:
        print("".join(f"{column:>12}" for column in columns))
    wrong = False
    for path in options.files:
        found = list(edges_of(shape_of(path), options.samples))
        smooth = [edge for edge in found if len(edge[0]) and np.median(edge[0]) < SMOOTH]
        figures = ours(tool, path)
        row = [os.path.basename(path), str(len(smooth)), str(len(found) - len(smooth))]
        if smooth:
            angles = np.concatenate([edge[0] for edge in smooth])
            weights = np.concatenate([np.full(len(a), length / len(a)) for a, length in smooth])
            share = lambda limit: weights[angles > limit].sum() / weights.sum()
            row += [f"{quantile(angles, weights, s):.3f}" for s in (0.95, 0.99)]
            row += [f"{angles.max():.3f}", f"{100 * share(0.1):.2f} %", f"{100 * share(0.5):.2f} %"]
            bound = figures["bound"]
            row.append("none" if bound is None else f"{bound:.3f}")
            wrong |= bound is not None and angles.max() > bound * (1 + SLACK) + ROUNDING
        else:
            row += ["-"] * 6
        wrong |= len(smooth) != figures["smooth"]
        if options.markdown:
            print("| " + " | ".join(row) + " |")
        else:
            print("".join(f"{cell:>12}" for cell in row))
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
