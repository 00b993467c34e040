"""What each number found by trial does: vary it by a third either way, fit a set of scans, and write a table.

Numbers found by trial stand as constants beside the code that uses them, with a sentence that begins with `Trial:`. This
script copies the tree, turns these constants into values that an environment variable can replace, builds the copy once,
and runs it once per constant and direction. The tree itself has no switch for it.

    python compare/ablate.py --crate nurbskin-fit --under fit --scratch /tmp/ablate [--data FOLDER] [--out table.md]
"""

import argparse
import concurrent.futures
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CONST = re.compile(
    r"(?P<doc>(?:^[ \t]*///[^\n]*\n)+)^(?P<vis>(?:pub(?:\([a-z]+\))? )?)const (?P<name>[A-Z0-9_]+): (?P<type>f64|usize|u32|i32) = "
    r"(?P<value>[0-9_.e-]+);",
    re.M,
)
# Simulated scans: shape, points, noise. Small, since every constant takes two rounds of all of them.
SIMULATED = [
    ("saddle", 3000, 0.0),
    ("face", 6000, 0.05),
    ("pot", 5000, 0.1),
    ("tube", 4000, 0.02),
    ("ellipsoid", 4000, 0.0),
    ("torus", 4000, 0.05),
    ("handle", 5000, 0.05),
]
# Real scans, where the folder is there: file, flags.
REAL = [
    ("tubes/ycb_mustard_body_crop.ply", ["-t", "0.3%"]),
    ("tubes/ycb_banana.obj", ["--unit", "m", "-t", "1mm"]),
    ("faces/rvcg_humface.ply", ["--max-control-points", "150"]),
]


def masked(text):
    """The text with comments and strings blanked, of the same length."""
    pattern = re.compile(r'//[^\n]*|"(?:\\.|[^"\\])*"', re.S)
    return pattern.sub(lambda m: re.sub(r"[^\n]", " ", m.group(0)), text)


def constants(folder):
    """Constants of the files under a folder whose documentation says `Trial:`."""
    found = []
    for path in sorted(folder.rglob("*.rs")):
        for match in CONST.finditer(path.read_text()):
            if "Trial:" in match["doc"]:
                found.append((path, match["name"], match["type"], match["value"]))
    return found


def make_static(scratch, crate, path, name, kind, value, undo):
    """Turns a constant of the copy into a value that NURBSKIN_TRIAL can replace, and reads it so everywhere."""
    text = path.read_text()
    key = f"{path.relative_to(scratch / 'crates' / crate / 'src')}:{name}"
    pattern = re.compile(rf"const {name}: {kind} = {re.escape(value)};")
    # Uses first, so that the definition is not one.
    for other in (path.parent.rglob("*.rs") if "pub" not in text[: text.index(f"const {name}:")].splitlines()[-1] else (scratch / "crates" / crate / "src").rglob("*.rs")):
        body = other.read_text()
        if name not in body:
            continue
        if other != path and not re.search(rf"use [^;]*\b{path.stem}::[^;]*\b{name}\b", body):
            continue
        hidden, out, at = masked(body), [], 0
        for use in re.finditer(rf"(?<![\w:]){name}(?!\w)", hidden):
            line = hidden[hidden.rfind("\n", 0, use.start()) + 1 : use.start()]
            statement = hidden[hidden.rfind(";", 0, use.start()) + 1 : use.start()]
            if re.search(r"\bconst $|\bstatic $", line) or re.search(r"\buse\b[^;]*$", statement):
                continue
            out += [body[at : use.start()], f"(*{name})"]
            at = use.end()
        undo.setdefault(other, body)
        other.write_text("".join(out) + body[at:])
    text = path.read_text()
    replaced = (
        f"static {name}: std::sync::LazyLock<{kind}> = std::sync::LazyLock::new(|| "
        f'std::env::var("NURBSKIN_TRIAL").ok().and_then(|t| t.strip_prefix("{key}=").and_then(|v| v.parse().ok()))'
        f".unwrap_or({value}));"
    )
    path.write_text(pattern.sub(lambda _: replaced, text, count=1))
    return key


def instrumented(scratch, crate, folder):
    """The constants of the copy that could be turned into values, by key."""
    keys = {}
    for path, name, kind, value in constants(folder):
        undo = {path: path.read_text()}
        key = make_static(scratch, crate, path, name, kind, value, undo)
        keys[key] = (path, name, kind, value, undo)
    # A constant that stands in a pattern or a length stays one.
    while True:
        run = subprocess.run(
            ["cargo", "check", "--quiet", "-p", crate, "--message-format", "short"],
            cwd=scratch, capture_output=True, text=True, env={**os.environ, "RUSTFLAGS": "-Awarnings"},
        )
        if run.returncode == 0:
            return keys
        bad = set()
        for line in run.stderr.splitlines():
            at = re.match(r"(?P<file>\S+?):(?P<line>\d+):\d+: error", line)
            if at:
                source = (scratch / at["file"]).read_text().splitlines()
                near = "\n".join(source[max(0, int(at["line"]) - 2) : int(at["line"]) + 1])
                bad |= {k for k, v in keys.items() if re.search(rf"\b{v[1]}\b", near)}
        if not bad:
            sys.exit(run.stderr)
        # Everything anew without them: edits of one file may overlap.
        for key in bad:
            print("stays a constant:", key, file=sys.stderr)
        wanted = [v[:4] for k, v in keys.items() if k not in bad]
        for _, _, _, _, undo in reversed(list(keys.values())):
            for file, text in undo.items():
                file.write_text(text)
        keys = {}
        for path, name, kind, value in wanted:
            undo = {path: path.read_text()}
            key = make_static(scratch, crate, path, name, kind, value, undo)
            keys[key] = (path, name, kind, value, undo)


def varied(kind, value, factor):
    number = float(value.replace("_", ""))
    if kind == "f64":
        return repr(number * factor)
    changed = round(number * factor)
    return str(changed if changed != number else int(number) + (1 if factor > 1 else -1))


def measured(tool, scan, flags, trial):
    """Verdict, control points and the 95 % distance of one fit; or the words of its refusal."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.step"
        env = {**os.environ, "RAYON_NUM_THREADS": "1", "SOURCE_DATE_EPOCH": "0"}
        if trial:
            env["NURBSKIN_TRIAL"] = trial
        try:
            run = subprocess.run(
                [tool, "fit", scan, "-o", out, "--json", "--quiet", *flags], capture_output=True, text=True, env=env, timeout=120
            )
            fit = json.loads(run.stdout)
        except (subprocess.TimeoutExpired, json.JSONDecodeError):
            return {"verdict": "no answer"}
        if "error" in fit:
            return {"verdict": "refused"}
        every = fit.get("parts") or [{"surface": fit["surface"]}]
        return {
            "verdict": fit["verdict"],
            "points": sum(p["surface"]["control_points"][0] * p["surface"]["control_points"][1] for p in every),
            "p95": fit["deviation"]["scan_to_surface"]["p95"],
            "max": fit["deviation"]["scan_to_surface"]["max"],
        }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--crate", default="nurbskin-fit")
    parser.add_argument("--under", default="fit", help="module of the crate")
    parser.add_argument("--scratch", type=Path, required=True)
    parser.add_argument("--data", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    asked = parser.parse_args()
    scratch = asked.scratch / "tree"
    shutil.rmtree(scratch, ignore_errors=True)
    shutil.copytree(ROOT, scratch, ignore=shutil.ignore_patterns("target", ".git", "corpus", "artifacts"))
    keys = instrumented(scratch, asked.crate, scratch / "crates" / asked.crate / "src" / asked.under)
    print(len(keys), "constants", file=sys.stderr)
    subprocess.run(["cargo", "build", "--release", "--quiet", "-p", "nurbskin", "--bin", "nurbskin"], cwd=scratch, check=True,
                   env={**os.environ, "RUSTFLAGS": "-Awarnings"})
    target = Path(os.environ.get("CARGO_TARGET_DIR", scratch / "target"))
    tool = target / "release" / "nurbskin"
    scans = []
    for shape, points, noise in SIMULATED:
        scan = asked.scratch / f"{shape}.ply"
        subprocess.run([tool, "simulate", shape, "--points", str(points), "--noise", str(noise), "--shuffled", "--quiet", "-o", scan],
                       check=True)
        scans.append((scan, ["-t", "0.4mm"]))
    for file, flags in REAL:
        if asked.data and (asked.data / file).exists():
            scans.append((asked.data / file, flags))
    runs = [(key, factor) for key in keys for factor in (2 / 3, 4 / 3)]
    with concurrent.futures.ThreadPoolExecutor(asked.jobs) as pool:
        def all_of(trial):
            return [measured(tool, scan, flags, trial) for scan, flags in scans]

        base = all_of(None)
        trials = [f"{key}={varied(keys[key][2], keys[key][3], factor)}" for key, factor in runs]
        results = []
        for done, found in enumerate(pool.map(all_of, trials), 1):
            results.append(found)
            if done % 10 == 0:
                print(f"{done} of {len(trials)}", file=sys.stderr, flush=True)
    rows = {}
    for (key, factor), found in zip(runs, results):
        changed = [(b, f) for b, f in zip(base, found) if b != f]
        both = [(b, f) for b, f in changed if "points" in b and "points" in f]
        points = [f["points"] / b["points"] - 1 for b, f in both]
        p95 = [f["p95"] / b["p95"] - 1 for b, f in both]
        verdicts = sum(b["verdict"] != f["verdict"] for b, f in changed)
        widest = lambda shares: f"{100 * min(shares):+.0f} .. {100 * max(shares):+.0f} %" if shares else "-"
        rows.setdefault(key, {})[factor] = (len(changed), verdicts, widest(points), widest(p95))
    lines = [
        f"{len(scans)} scans; each constant less and more by a third: scans whose surface changes, verdicts that change, and the "
        "range of the change in control points and in the distance of 95 % of the points.",
        "",
        "| constant | value | changed, - / + | verdicts, - / + | control points, - | + | p95, - | + |",
        "|---|---|---|---|---|---|---|---|",
    ]
    order = sorted(rows, key=lambda k: (-sum(r[1] for r in rows[k].values()), -sum(r[0] for r in rows[k].values()), k))
    for key in order:
        less, more = rows[key][2 / 3], rows[key][4 / 3]
        lines.append(
            f"| `{key}` | {keys[key][3]} | {less[0]} / {more[0]} | {less[1]} / {more[1]} | {less[2]} | {more[2]} | {less[3]} | {more[3]} |"
        )
    text = "\n".join(lines) + "\n"
    if asked.out:
        asked.out.write_text(text)
    else:
        print(text)


if __name__ == "__main__":
    main()
