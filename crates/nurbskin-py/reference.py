"""Writes the reference of the Python package, docs/python-api.md, from the docstrings and the type stubs.

    python crates/nurbskin-py/reference.py            # after the package is installed
    python crates/nurbskin-py/reference.py --check    # exit status 1 if the page is out of date
"""

from __future__ import annotations

import ast
import inspect
import pathlib
import re
import sys
import textwrap

import nurbskin
import nurbskin.cluster

HERE = pathlib.Path(__file__).resolve().parent
#: The page.
PAGE = HERE.parents[1] / "docs" / "python-api.md"
#: Where signatures with types stand.
SOURCES = [HERE / "python" / "nurbskin" / name for name in ("_nurbskin.pyi", "_api.py", "_types.py", "_errors.py", "cluster.py")]
#: The stubs' own names of types.
SHORT = {"_Floats": "NDArray[np.float64]", "_Path": "str | os.PathLike", "_Progress": "Callable[[str, int, int | None], object]"}
#: Longest line of the page, as in all Markdown of the project.
WIDTH = 130
#: The parts of the page, and what is in each. A name that stands in none is an error.
PARTS = {
    "Fit and compare": ["fit", "deviation", "Result", "Comparison", "Measurement", "Deviation", "FaceEdge"],
    "Files": ["read", "read_cad", "check", "convert", "info", "view", "Scan", "CadModel", "Page"],
    "Surfaces and curves": ["NurbsSurface", "NurbsCurve", "Curvature", "ClosestPoints"],
    "Layers": [
        "interpolate",
        "approximate",
        "rarefy",
        "enrich",
        "simulate",
        "NormalSums",
        "Interpolation",
        "Approximation",
        "Rarefaction",
    ],
    "Errors": ["Error", "ReadError", "WriteError", "InvalidError", "UnsupportedError", "NoSolutionError"],
}

HEAD = f"""# Reference of the Python package

Every function, class and error of `nurbskin`. [The Python package](python.md) explains how they go together. This page is
generated from the docstrings; `python crates/{HERE.name}/reference.py` writes it anew.
"""


def definitions() -> dict[str, ast.AST]:
    """The public functions and classes of the sources, and the members of the classes, by name."""
    found: dict[str, ast.AST] = {}
    for path in SOURCES:
        prefix = "cluster." if path.stem == "cluster" else ""
        text = path.read_text(encoding="utf-8")
        for name, kind in SHORT.items():
            # Where it is used, which is never at the beginning of a line.
            text = re.sub(rf"(?<=.)\b{name}\b", kind, text)
        for node in ast.parse(text).body:
            if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
                found[prefix + node.name] = node
            for member in node.body if isinstance(node, ast.ClassDef) else []:
                if isinstance(member, ast.FunctionDef):
                    found[f"{prefix}{node.name}.{member.name}"] = member
    return found


def signature(name: str, node: ast.FunctionDef, method: bool) -> str:
    """A signature with types, on one line or one line per argument."""
    given = node.args
    if method:
        given.args = [a for a in given.args if a.arg != "self"]
    every = [*given.posonlyargs, *given.args]
    optional: list[ast.expr | None] = [None] * (len(every) - len(given.defaults)) + list(given.defaults)

    def one(argument: ast.arg, default: ast.expr | None, before: str = "") -> str:
        kind = f": {ast.unparse(argument.annotation)}" if argument.annotation else ""
        value = f"{' = ' if kind else '='}{ast.unparse(default)}" if default is not None else ""
        return f"{before}{argument.arg}{kind}{value}".replace("'", '"')

    parts = [one(a, d) for a, d in zip(every, optional)]
    if given.vararg:
        parts.append(one(given.vararg, None, "*"))
    elif given.kwonlyargs:
        parts.append("*")
    parts += [one(a, d) for a, d in zip(given.kwonlyargs, given.kw_defaults)]
    if given.kwarg:
        parts.append(one(given.kwarg, None, "**"))
    back = f" -> {ast.unparse(node.returns)}".replace("'", '"') if node.returns and node.name != "__init__" else ""
    line = f"{name}({', '.join(parts)}){back}"
    if len(line) <= WIDTH - 10:
        return line
    return "\n".join([f"{name}(", *(f"    {part}," for part in parts), f"){back}"])


def markdown(text: str) -> str:
    """The words of a docstring: its roles and its literals as Markdown's code."""
    text = re.sub(r":(?:func|class|meth|attr|mod):`([^`]+)`", r"`\1`", text)
    return re.sub(r"``(.+?)``", r"`\1`", text)


def wrapped(text: str, first: str = "", rest: str = "") -> str:
    return textwrap.fill(
        " ".join(text.split()), WIDTH, initial_indent=first, subsequent_indent=rest, break_long_words=False, break_on_hyphens=False
    )


def documented(text: str) -> list[str]:
    """A docstring in the manner of numpy's as Markdown."""
    out: list[str] = []
    parts = re.split(r"^([A-Z][a-z]+)\n-+\n", text, flags=re.MULTILINE)
    for paragraph in parts[0].split("\n\n"):
        if paragraph.strip().startswith(">>>"):
            out += ["```python", paragraph.strip(), "```", ""]
        elif paragraph.strip():
            out += [wrapped(markdown(paragraph)), ""]
    for title, body in zip(parts[1::2], parts[2::2]):
        out += [f"**{title}**", ""]
        if title == "Examples":
            out += ["```python", body.strip(), "```", ""]
            continue
        # An entry begins at the margin; what belongs to it is indented.
        for entry in re.split(r"\n(?=\S)", body.strip()):
            name, colon, rest = entry.partition(" : ")
            said = f"`{name}`: {markdown(rest)}" if colon else markdown(entry)
            out.append(wrapped(said, "- ", "  "))
        out.append("")
    return out


def doc_of(thing: object, name: str) -> str:
    text = inspect.getdoc(thing)
    if not text:
        raise SystemExit(f"{name} has no docstring")
    return text


def of_function(name: str, thing: object, known: dict[str, ast.AST]) -> list[str]:
    node = known[name]
    assert isinstance(node, ast.FunctionDef)
    return [f"### {name}", "", "```python", signature(name, node, False), "```", "", *documented(doc_of(thing, name))]


def of_class(name: str, thing: type, known: dict[str, ast.AST]) -> list[str]:
    out = [f"### {name}", ""]
    start = known.get(f"{name}.__init__")
    if isinstance(start, ast.FunctionDef):
        out += ["```python", signature(name, start, True), "```", ""]
    bases = [base.__name__ for base in thing.__bases__ if base not in (object, tuple, str)]
    if bases:
        out += [wrapped(f"A subclass of {' and '.join(f'`{base}`' for base in bases)}."), ""]
    out += documented(doc_of(thing, name))
    if issubclass(thing, (tuple, str, BaseException)):
        return out
    attributes, methods = [], []
    for member in sorted(vars(thing)):
        if member.startswith("_"):
            continue
        node = known[f"{name}.{member}"]
        assert isinstance(node, ast.FunctionDef)
        text = doc_of(getattr(thing, member), f"{name}.{member}")
        if any(isinstance(d, ast.Name) and d.id == "property" for d in node.decorator_list):
            kind = ast.unparse(node.returns) if node.returns else ""
            attributes.append(wrapped(f"`{member}: {kind}`: {markdown(text)}", "- ", "  "))
        else:
            methods += [f"#### {name}.{member}", "", "```python", signature(member, node, True), "```", "", *documented(text)]
    if attributes:
        out += ["**Attributes**", "", *attributes, ""]
    return out + methods


def page() -> str:
    """The whole page."""
    known = definitions()
    named = {name for names in PARTS.values() for name in names}
    left = set(nurbskin.__all__) - named - {"__version__", "cluster"}
    if left or not named <= set(nurbskin.__all__):
        raise SystemExit(f"PARTS does not fit nurbskin.__all__: {sorted(left | (named - set(nurbskin.__all__)))}")
    out = [HEAD]
    for title, names in PARTS.items():
        out += [f"## {title}", ""]
        for name in names:
            thing = getattr(nurbskin, name)
            out += of_class(name, thing, known) if inspect.isclass(thing) else of_function(name, thing, known)
    out += ["## nurbskin.cluster", "", *documented(doc_of(nurbskin.cluster, "nurbskin.cluster"))]
    for name in nurbskin.cluster.__all__:
        full, thing = f"cluster.{name}", getattr(nurbskin.cluster, name)
        out += of_class(full, thing, known) if inspect.isclass(thing) else of_function(full, thing, known)
    return "\n".join(out).rstrip() + "\n"


def main() -> int:
    text = page()
    if "--check" in sys.argv[1:]:
        if not PAGE.exists() or PAGE.read_text(encoding="utf-8") != text:
            print(f"{PAGE} is out of date: run python crates/{HERE.name}/reference.py")
            return 1
        return 0
    PAGE.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
