#!/usr/bin/env python3
"""Fits the scans that may be shown and makes docs/gallery.md: for each the picture of its report, figures, the command.

    gallery.py DATA [NAME...] [--tool PATH] [--docs FOLDER] [--chromium PATH]

DATA is a folder of scans (tubes/, pots/, faces/, ...); with NAMEs only those whose path contains one of them are made
again. The pictures are taken of the report pages in headless Chromium (node and tests/pages/node_modules are needed).
"""
import argparse
import json
import pathlib
import subprocess
import tempfile

STANFORD = "Stanford Computer Graphics Laboratory, The Stanford 3D Scanning Repository."
YCB = "YCB Object and Model Set (Calli et al. 2015), CC BY 4.0; mesh decimated and reoriented."
VASE = "Ivan Nikolov, Claus Madsen, GGG-BenchmarkSfM, Mendeley Data, CC BY 4.0; decimated by the PyVista project."

GISMO = "G+Smo, MPL-2.0."
PCL = "Point Cloud Library, data repository, BSD."

# path, title, whose it is, which way to look (None: as the page opens), colours, unit of the numbers
SCANS = [
    ("faces/fran_cut.ply", "A face, laser digitizer", "VTK data, BSD-3-Clause.", None, "deviation", "m"),
    ("faces/lee_perry_smith_head.ply", "A head and shoulders", "\"Infinite, 3D Head Scan by Lee Perry-Smith\", CC BY 3.0, "
     "based on a work at triplegangers.com / ir-ltd.net.", "top", "deviation", None),
    ("tubes/ycb_mustard_bottle.obj", "A bottle, closed", YCB, None, "deviation", "m"),
    ("tubes/ycb_mustard_body_crop.ply", "Its body, an open tube", YCB + " Cropped.", None, "zebra", "m"),
    ("tubes/ycb_banana.obj", "A banana", YCB, None, "deviation", "m"),
    ("pots/plastic_vase.ply", "A fluted vase, inside and outside", VASE, None, "deviation", None),
    ("pots/ycb_bowl_16k.stl", "A bowl, a closed thin shell", YCB, None, "deviation", "m"),
    ("pots/ycb_tomato_soup_can.obj", "A can, bumpy as it was scanned", YCB, None, "deviation", "m"),
    ("pots/ycb_master_chef_can.obj", "A can with 94 spurious handles", YCB, None, "deviation", "m"),
    ("patches/neon_side_panel.off", "A car's side panel, its windows cut out", GISMO, "top", "zebra", None),
    ("patches/gismo_deepdrawingC_xyzuv.txt", "A deep-drawn cup", GISMO, None, "deviation", None),
    ("organised/stanford_bun000.ply", "One range image of the bunny", STANFORD, "top", "deviation", "m"),
    ("organised/stanford_bun090.ply", "The next one, from the side", STANFORD, "top", "deviation", "m"),
    ("organised/stanford_bun180.ply", "From behind", STANFORD, "top", "deviation", "m"),
    ("organised/stanford_bun270.ply", "From the other side", STANFORD, "top", "deviation", "m"),
    ("organised/pcl_table_scene_mug.pcd", "A mug on a table, stereo", PCL, "top", "deviation", "m"),
    ("organised/mosd_learn36_cylinders.pcd", "Cylinders on a table, Kinect", PCL, "top", "deviation", "m"),
    ("classics/stanford_bun_zipper.ply", "The bunny, closed", STANFORD, "top", "deviation", "m"),
]

# Closed scans that become networks: the pictures show one surface.
SINGLE = {"ycb_mustard_bottle", "ycb_banana", "ycb_bowl_16k", "ycb_tomato_soup_can", "ycb_master_chef_can", "stanford_bun_zipper"}


def length(x, unit):
    """Three digits in a unit of a fitting size, as the messages have it."""
    metres = x * {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "ft": 0.3048}[unit]
    for symbol, size in (("m", 1.0), ("mm", 1e-4), ("um", 1e-7), ("nm", 0.0)):
        if metres >= size:
            return f"{metres / {'m': 1.0, 'mm': 1e-3, 'um': 1e-6, 'nm': 1e-9}[symbol]:.3g} {symbol}"


def figures(result):
    there, back = result["deviation"]["scan_to_surface"], result["deviation"]["surface_to_scan"]
    surface, unit = result["surface"], result["input"]["unit"]
    low, high = result["input"]["bounding_box"]
    diagonal = sum((b - a) ** 2 for a, b in zip(low, high)) ** 0.5
    if surface["layout"] == "network":
        shape = f"network of {surface['faces']} faces, {surface['control_points'][0]} control points"
    else:
        shape = "{}, {} x {} control points".format(surface["topology"], *surface["control_points"])
    said = f"{result['input']['points']} points, "
    parts = result.get("parts", [])
    if parts:
        said += f"{len(parts)} surfaces, the largest a "
    said += shape
    if surface["trimmed"]:
        said += ", trimmed"
    share = lambda x: f"{100 * x / diagonal:.3f} %"
    return (f"{said}. Half of the points are within {length(there['p50'], unit)} ({share(there['p50'])} of the box diagonal), "
            f"95 % within {length(there['p95'], unit)} ({share(there['p95'])}); surface to scan, 95 % within {share(back['p95'])}. "
            f"{100 * back['unsupported_area']:.2f} % of the area has no data under it.")


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("data", type=pathlib.Path)
    arguments.add_argument("names", nargs="*")
    root = pathlib.Path(__file__).resolve().parent.parent
    arguments.add_argument("--tool", default=str(root / "target/release/nurbskin"))
    arguments.add_argument("--docs", type=pathlib.Path, default=root / "docs")
    arguments.add_argument("--chromium", default="/usr/bin/chromium")
    options = arguments.parse_args()
    pictures = options.docs / "gallery"
    pictures.mkdir(exist_ok=True)
    lines = ["# Gallery", "",
             "Real scans, each fitted by the one command shown, without a tolerance; `--unit` is given where the file does not say that its",
             "numbers are not millimetres. The pictures show the report pages. Blue is inside, red outside; the scale ends at the 95th",
             "percentile of the distances, and cyan and yellow lie beyond it. Grey hatching has no data under it.",
             "\"Surface to scan\" is the distance of places of the surface from the scan.",
             "Made by `compare/gallery.py`.", ""]
    # What was measured when the pictures were taken.
    kept = pictures / "figures.json"
    known = json.loads(kept.read_text()) if kept.exists() else {}
    with tempfile.TemporaryDirectory() as folder:
        for path, title, owner, view, mode, unit in SCANS:
            name = pathlib.Path(path).stem
            scan = options.data / path
            if not options.names or any(part in path for part in options.names) or name not in known:
                page = pathlib.Path(folder) / f"{name}.html"
                command = [options.tool, "fit", str(scan), "-o", str(page.with_suffix(".step")), "--report", str(page), "--json"]
                command += ["--unit", unit] if unit else []
                command += ["--layout", "single"] if name in SINGLE else []
                done = subprocess.run(command, capture_output=True, text=True)
                if done.returncode not in (0, 3):
                    raise SystemExit(f"{path}: {done.stderr}")
                known[name] = figures(json.loads(done.stdout))
                subprocess.run(["node", str(root / "tests/pages/picture.mjs"), "--chromium", options.chromium, "--mode", mode,
                                "--view", view or "", str(page), str(pictures / f"{name}.png")], check=True)
            lines += [f"## {title}", "", f"![{title}](gallery/{name}.png)", "", known[name], "",
                      "```sh", f"nurbskin fit {scan.name} -o {name}.step --report {name}.html" + (f" --unit {unit}" if unit else "")
                      + (" --layout single" if name in SINGLE else ""), "```", "", owner, ""]
            print(name, flush=True)
    lines += ["## What is not one surface",
              "",
              "`sea_vase.ply`, a jug with a handle, and `aorta2.stl`, a branching vessel, are not one surface. `nurbskin fit` makes a",
              "network of faces of each; `--layout single` says the number of handles and openings found."]
    kept.write_text(json.dumps(known, indent=1) + "\n")
    (options.docs / "gallery.md").write_text("\n".join(lines).rstrip() + "\n")


if __name__ == "__main__":
    main()
