"""What is documented is there, and does what it says."""

import ast
import doctest
import importlib.metadata
import inspect
import pathlib
import runpy

import pytest

import nurbskin
import nurbskin._api
import nurbskin._nurbskin as native

PACKAGE = pathlib.Path(nurbskin.__file__).parent


def test_examples_run():
    finder, runner = doctest.DocTestFinder(), doctest.DocTestRunner()
    tests = doctest.DocTestFinder().find(nurbskin, "nurbskin") + finder.find(nurbskin._api, "api")
    parser = doctest.DocTestParser()
    tests.append(parser.get_doctest(inspect.getdoc(nurbskin.NurbsSurface), {}, "NurbsSurface", None, None))
    results = [runner.run(test) for test in tests]
    assert sum(result.attempted for result in results) >= 8
    assert sum(result.failed for result in results) == 0


def public():
    for name in nurbskin.__all__:
        thing = getattr(nurbskin, name)
        if not callable(thing):
            continue
        yield name, thing
        if inspect.isclass(thing) and not issubclass(thing, Exception):
            for member, value in vars(thing).items():
                if not member.startswith("_"):
                    yield f"{name}.{member}", value


@pytest.mark.parametrize("name,thing", list(public()))
def test_everything_public_is_documented(name, thing):
    assert inspect.getdoc(thing), name


def test_the_reference_is_up_to_date():
    generator = pathlib.Path(__file__).parents[1] / "reference.py"
    reference = runpy.run_path(str(generator))
    page = reference["page"]()
    assert page == reference["PAGE"].read_text(encoding="utf-8"), "run python crates/nurbskin-py/reference.py"
    for name in nurbskin.__all__:
        assert name in ("__version__", "cluster") or f"\n### {name}\n" in page, name
    outside = [line for line in page.splitlines() if len(line) > reference["WIDTH"]]
    assert outside == []


def test_the_package_has_its_licences():
    about = importlib.metadata.distribution("nurbskin")
    assert about.metadata["License-Expression"] == "MIT OR Apache-2.0"
    names = about.metadata.get_all("License-File")
    assert sorted(names) == ["LICENSE-APACHE", "LICENSE-MIT"]
    for name in names:
        text = (pathlib.Path(__file__).parents[3] / name).read_text(encoding="utf-8")
        assert about.read_text(f"licenses/{name}") == text, name


def test_the_stubs_are_of_what_is_there():
    assert (PACKAGE / "py.typed").exists()
    tree = ast.parse((PACKAGE / "_nurbskin.pyi").read_text())
    stubs = {node.name: node for node in tree.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    there = {name for name in vars(native) if not name.startswith("_")}
    assert there == set(stubs)
    for name, node in stubs.items():
        if isinstance(node, ast.ClassDef):
            of_class = {n.name for n in node.body if isinstance(n, ast.FunctionDef)}
            members = {m for m in vars(getattr(native, name)) if not m.startswith("_")}
            assert members == {m for m in of_class if not m.startswith("_")}, name
            assert all(hasattr(getattr(native, name), m) for m in of_class), name
        functions = [node] if isinstance(node, ast.FunctionDef) else [n for n in node.body if isinstance(n, ast.FunctionDef)]
        for stub in functions:
            owner = native if isinstance(node, ast.FunctionDef) else getattr(native, name)
            real = getattr(owner, stub.name)
            if inspect.isroutine(real):
                if stub.name.startswith("__"):
                    continue
                a = stub.args
                said = [x.arg for x in a.args + a.kwonlyargs] + [x.arg for x in (a.vararg, a.kwarg) if x]
                got = list(inspect.signature(real).parameters)
                assert sorted(said) == sorted(got), f"{name}.{stub.name}"
