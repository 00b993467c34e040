"""The functions of the package."""

from __future__ import annotations

import os
import pathlib
import webbrowser
from typing import Any, Literal, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _nurbskin
from ._errors import InvalidError
from ._input import grid_of, scan_of
from ._nurbskin import CadModel, Comparison, NurbsSurface, Result, Scan
from ._progress import Callback, told
from ._types import Approximation, Interpolation, Rarefaction

Path = str | os.PathLike[str]
Topology = Literal["auto", "disk", "tube", "sphere", "torus"]
Unit = Literal["auto", "mm", "cm", "m", "um", "in", "ft"]


def read(path: Path, *, format: str | None = None) -> Scan:
    """Reads a scan: PLY, STL, OBJ, OFF, VTK, VTP, PCD, PTX, E57, LAS, LAZ, NPY or text, told by content, also with .gz.

    Parameters
    ----------
    path : the file.
    format : ``"ply"``, ``"stl"``, ``"obj"``, ``"off"``, ``"xyz"``, ``"asc"``, ``"txt"``, ``"csv"``, ``"pts"``, ``"pcd"``,
        ``"ptx"``, ``"e57"``, ``"las"``, ``"laz"``, ``"npy"``, ``"vtk"`` or ``"vtp"``; told by extension and content where None.

    Raises
    ------
    FileNotFoundError : if there is no such file.
    ReadError : if the file cannot be read; the text names the file, the line or record, and what to do.
    UnsupportedError : for a known format without a reader.
    """
    return _nurbskin.read(os.fspath(path), format=format)


def read_cad(path: Path, *, format: Literal["step", "iges"] | None = None) -> CadModel:
    """Reads a CAD file: STEP or IGES, told by content, also with .gz.

    Parameters
    ----------
    path : the file.
    format : told by extension and content where None.

    Raises
    ------
    FileNotFoundError : if there is no such file.
    ReadError : if the file cannot be read, or is a scan.

    Examples
    --------
    >>> import nurbskin, os, tempfile
    >>> path = os.path.join(tempfile.mkdtemp(), "part.step")
    >>> nurbskin.fit(nurbskin.simulate("saddle", points=2500)).model.write(path)
    []
    >>> nurbskin.read_cad(path)
    CadModel(1 face, mm)
    """
    return _nurbskin.read_cad(os.fspath(path), format=format)


def _input(data: Any) -> Any:
    """A file, or something with points or faces, as the compiled functions take it."""
    if isinstance(data, (str, os.PathLike)):
        return os.fspath(data)
    if isinstance(data, (Scan, CadModel, Result, NurbsSurface)):
        return data
    return scan_of(data)


def deviation(
    scan: Any,
    cad: Path | CadModel | Result | NurbsSurface,
    tolerance: float | str | None = None,
    *,
    align: bool = False,
    within: float | None = None,
    min_coverage: float | None = None,
    unit: Unit = "auto",
    progress: Callback | bool | None = None,
) -> Comparison:
    """Measures the deviation of a scan from a CAD model, as ``nurbskin deviation`` does.

    The distance of every point to the nearest place on the trimmed faces has a guaranteed lower and upper bound; positive is
    outside. The other way round, the parts of the model without scan data are found.

    Parameters
    ----------
    scan : whatever :func:`fit` takes: points, meshes, a :class:`Scan`, or the path of a file.
    cad : the path of a STEP or IGES file, a :class:`CadModel`, the :class:`Result` of a fit, or a surface.
    tolerance : largest distance allowed, as in :func:`fit`; where None figures are measured and nothing is judged.
    align : whether the scan is first moved (rigidly) to where it fits best. It must lie roughly in place already.
    within : share (0 to 1) of the points that must be within the tolerance; 1 for ordered points, else 0.995, where None.
    min_coverage : share (0 to 1) of the nominal's area that must have data for a ``pass``; 0.9 where None, 0 for none.
    unit : of the points; from the file, else mm, where ``"auto"``.
    progress : as for :func:`fit`.

    Raises
    ------
    FileNotFoundError : if there is no such file.
    ReadError : if a file cannot be read, or the model has no faces.
    InvalidError : for arguments that make no sense, or a scan without points.

    Examples
    --------
    >>> import nurbskin
    >>> scan = nurbskin.simulate("saddle", points=2500)
    >>> result = nurbskin.fit(scan, tolerance=0.01)
    >>> nurbskin.deviation(scan, result, tolerance=0.01).verdict
    'pass'
    """
    with told(progress) as callback:
        return _nurbskin.deviation(
            _input(scan),
            _input(cad),
            tolerance=tolerance,
            within=within,
            min_coverage=min_coverage,
            align=align,
            unit=unit,
            progress=callback,
        )


def check(cad: Path | CadModel | Result | NurbsSurface) -> dict[str, Any]:
    """Checks the quality of a CAD file, as ``nurbskin check`` does.

    Gaps between edges and faces, tangency and curvature across edges and knots, degrees, narrow knot spans, tiny edges, folds
    and self-intersections, loops, orientation, free edges, and whether the file reads back the same. The limits are those of
    SASIG PDQ and VDA 4955.

    Parameters
    ----------
    cad : the path of a STEP or IGES file, a :class:`CadModel`, the :class:`Result` of a fit, or a surface.

    Returns
    -------
    dict : the JSON of the command: ``verdict`` (``"pass"``, ``"fail"`` or ``"not_checked"``), ``reasons``, ``checks``, each
        with the measured value, the limit and the worst place, and more.

    Raises
    ------
    FileNotFoundError : if there is no such file.
    ReadError : if the file cannot be read, or is a scan.

    Examples
    --------
    >>> import nurbskin
    >>> nurbskin.check(nurbskin.fit(nurbskin.simulate("saddle", points=2500)))["verdict"]
    'pass'
    """
    return _nurbskin.check(_input(cad))


def convert(
    file: Any,
    *outputs: Path,
    tolerance: float | str | None = None,
    unit: Unit = "auto",
    to_unit: Unit = "auto",
    step_schema: Literal["ap214", "ap242"] | None = None,
    author: str | None = None,
    organization: str | None = None,
) -> dict[str, Any]:
    """Converts scan to scan, CAD to CAD, or CAD to mesh, as ``nurbskin convert`` does.

    Parameters
    ----------
    file : a scan or a CAD file, or what :func:`deviation` takes for one.
    outputs : files to write, each in the format of its extension: .step, .stp, .igs or .iges; .stl, .obj, .ply or .glb; of a
        scan .ply, .xyz, .txt, .asc, .csv, .stl or .obj. A file that is there is replaced.
    tolerance : largest distance between a CAD surface and the triangles of a mesh; 0.01 % of the diagonal where None.
    unit : of the input; from the file, else mm, where ``"auto"``.
    to_unit : of the output; numbers are converted. The input's where ``"auto"``.
    step_schema : application protocol of STEP files; ``"ap214"`` where None.
    author, organization : for the headers of CAD files; the input's where None.

    Returns
    -------
    dict : the JSON of the command: ``input``, ``outputs``, ``warnings``.

    Raises
    ------
    FileNotFoundError : if there is no such file, or no such folder to write to.
    InvalidError : for a scan that shall become a CAD file, which is what :func:`fit` does, and for unknown extensions.
    ReadError, WriteError : if a file cannot be read or written; nothing is left behind then.
    """
    return _nurbskin.convert(
        _input(file),
        [os.fspath(path) for path in outputs],
        tolerance=tolerance,
        unit=unit,
        to_unit=to_unit,
        step_schema=step_schema,
        author=author,
        organization=organization,
    )


def info(file: Any) -> dict[str, Any]:
    """What is in a scan or a CAD file, as ``nurbskin info`` prints it.

    Of a scan: size, unit, points, order, spacing, noise, separate parts, and its topology where it can be told without a fit.
    Of a CAD file: size, unit, solids, shells and faces, area and volume, surfaces, and its header.

    Parameters
    ----------
    file : a scan or a CAD file, or what :func:`deviation` takes for one.

    Returns
    -------
    dict : one of the ``files`` in the JSON of the command; ``kind`` is ``"scan"`` or ``"cad"``.

    Raises
    ------
    FileNotFoundError : if there is no such file.
    ReadError : if the file cannot be read.

    Examples
    --------
    >>> import nurbskin
    >>> found = nurbskin.info(nurbskin.simulate("torus", points=900))
    >>> found["kind"], found["organisation"], found["topology"]
    ('scan', 'grid', 'torus')
    """
    return _nurbskin.info(_input(file))


def view(file: Any, output: Path | None = None, *, open: bool = True) -> pathlib.Path:
    """Shows a scan or a CAD file in the browser, as ``nurbskin view`` does.

    Parameters
    ----------
    file : a scan or a CAD file, or what :func:`deviation` takes for one.
    output : file for the page, which works offline (.html); in the folder for temporary files where None.
    open : whether the page is opened.

    Returns
    -------
    pathlib.Path : the page.

    Raises
    ------
    FileNotFoundError : if there is no such file, or no such folder to write to.
    ReadError, WriteError : if a file cannot be read or written.
    """
    page = _nurbskin.view(_input(file), output=None if output is None else os.fspath(output))
    if open:
        webbrowser.open(page.absolute().as_uri())
    return page


def fit(
    points: Any,
    tolerance: float | str | None = None,
    *,
    within: float | None = None,
    min_coverage: float | None = None,
    layout: Literal["auto", "single", "network"] = "auto",
    sharp: float | Literal["auto", "off"] = "auto",
    method: Literal["auto", "interpolate", "approximate"] = "auto",
    topology: Topology = "auto",
    degree: int | Sequence[int] = 3,
    parameters: Literal["auto", "uniform", "chord", "centripetal"] = "auto",
    grid: Sequence[int] | None = None,
    rarefy: float | tuple[float, float] | str | None = "auto",
    enrich: int = 0,
    max_control_points: int | None = None,
    trim: Literal["auto", "always", "off"] = "auto",
    unit: Unit = "auto",
    hold_out: float = 0.0,
    progress: Callback | bool | None = None,
) -> Result:
    """Fits NURBS surfaces to a scan: each separate part of it gets one, or a network of faces.

    Parameters
    ----------
    points : an (n, 3) array of points; an (m, n, 3) array of ordered points, NaN where there is none; a mesh or cloud of
        trimesh, Open3D or PyVista; a :class:`Scan`; or the path of a file.
    tolerance : largest distance allowed between scan and surface: ``0.05`` in the unit of the points, or ``"0.05mm"``,
        ``"20µm"``, ``"0,5mm"``, ``"2thou"``, ``"0.1%"`` (of the diagonal of the points). Where None the fit aims at what the
        noise of the points can carry, and the deviation is not judged.
    within : share (0 to 1) of the points that must be within the tolerance; 1 for ordered points, else 0.995, where None.
    min_coverage : share (0 to 1) of the surface's area that must have data under it; not asked where None.
    layout : ``"single"``: one surface; ``"network"``: a watertight network of four-sided faces, for any shape; ``"auto"``: one
        surface where it can be the part and meets the tolerance or aim with no more control points, else a network.
    sharp : feature lines that stay sharp in a network: those that bend by more than so many degrees, ``"auto"`` or ``"off"``.
    method : ``"interpolate"``: the paper's, through every kept point; ``"approximate"``: least squares.
    topology : shape of the domain, if it is not to be found from the data.
    degree : in u and v.
    parameters : for interpolation.
    grid : (M, N), if the points are N rows of M points each.
    rarefy : for ordered points: angle between normals in degrees, for u and v or both; ``"MxN"`` lines; ``"auto"`` or
        ``"off"``.
    enrich : Catmull-Clark levels for a sparse grid, 0 to 6.
    max_control_points : the budget.
    trim : whether the surface ends where the scan does.
    unit : of the points; from the file, else mm, where ``"auto"``.
    hold_out : part of the points (0 to 0.5) kept out of the fit and reported apart.
    progress : True for bars of tqdm, a class of tqdm's, or a function ``progress(stage, done, total)``. What it raises stops
        the fit.

    Returns
    -------
    Result : surface or faces, deviation, verdict with reasons; the surface is checked as the file would be. ``result.write("part.step")`` and ``result.report("part.html")`` write files.

    Raises
    ------
    InvalidError, ReadError : for arguments or files that make no sense.
    UnsupportedError : for shapes that cannot be fitted, and what they are.
    NoSolutionError : if there is no surface with these data and options.
    KeyboardInterrupt : after Ctrl-C.

    Examples
    --------
    >>> import nurbskin
    >>> scan = nurbskin.simulate("saddle", points=2500, shuffled=True)
    >>> result = nurbskin.fit(scan, tolerance=0.01)
    >>> result.verdict
    'pass'
    >>> result.surface(0.5, 0.5).shape
    (3,)
    """
    options = {
        "tolerance": tolerance,
        "within": within,
        "min_coverage": min_coverage,
        "layout": layout,
        "sharp": sharp,
        "method": method,
        "topology": topology,
        "degree": degree,
        "parameters": parameters,
        "grid": grid,
        "rarefy": rarefy,
        "enrich": enrich,
        "max_control_points": max_control_points,
        "trim": trim,
        "unit": unit,
        "hold_out": hold_out,
    }
    with told(progress) as callback:
        if isinstance(points, (str, os.PathLike)):
            return _nurbskin.fit_file(os.fspath(points), progress=callback, **options)
        return _nurbskin.fit(scan_of(points), progress=callback, **options)


def interpolate(
    grid: ArrayLike | Scan,
    degree: int | Sequence[int] = 3,
    *,
    parameters: Literal["auto", "uniform", "chord", "centripetal"] = "auto",
    topology: Topology = "disk",
    u: ArrayLike | None = None,
    v: ArrayLike | None = None,
    knots: tuple[ArrayLike, ArrayLike] | None = None,
) -> Interpolation:
    """The surface through every point of a grid, after Pal & Ballav 2007.

    Parameters
    ----------
    grid : (m, n, 3) points, u along the first axis, or an ordered scan; closed directions do not repeat their first line.
    degree : in u and v; a direction with too few lines gets less.
    parameters : how u and v follow from the points, if they are not given.
    topology : which directions are closed: periodic, with period 1.
    u, v : parameters of the lines, increasing, shapes (m,) and (n,).
    knots : clamped knot vectors of u and v, instead of averaged ones; then ``u`` and ``v`` are needed, too, unless their
        parameters run from 0 to 1.

    Raises
    ------
    InvalidError : if counts, degrees or parameters do not fit.
    NoSolutionError : if there is no such surface on the knots (Schoenberg and Whitney's condition).
    """
    knots_u, knots_v = (None, None) if knots is None else knots
    found = _nurbskin.interpolate(
        grid_of(grid), degree=degree, parameters=parameters, topology=topology, u=u, v=v, knots_u=knots_u, knots_v=knots_v
    )
    return Interpolation(*found)


def approximate(
    points: ArrayLike,
    uv: ArrayLike,
    tolerance: float | None = None,
    *,
    knots: tuple[ArrayLike, ArrayLike] | None = None,
    degree: int | Sequence[int] = 3,
    topology: Topology = "disk",
    max_control_points: int | None = None,
    noise: float | None = None,
    weights: ArrayLike | None = None,
    periodic: Sequence[bool] | None = None,
    smoothing: float = 0.0,
    size: Sequence[float] | None = None,
    progress: Callback | bool | None = None,
) -> Approximation:
    """The least-squares surface of points with known parameters: to a tolerance, or on given knots.

    Parameters
    ----------
    points : (n, 3).
    uv : (n, 2) parameters; in [0, 1] without ``knots``, else in their domain.
    tolerance : largest error of the surface; knots are put where they are needed. Weights are robust.
    knots : knot vectors of u and v, instead of a tolerance: plain least squares, once.
    degree : in u and v.
    topology, max_control_points, noise : with a tolerance: closed directions, budget, and the standard deviation of the
        points, where it is known.
    weights, periodic, smoothing : with knots: (n,) weights, which knot vectors are periodic, and the factor of the
        thin-plate energy.
    size : lengths that the domain stands for; by the box of the points, or (1, 1) with knots.
    progress : as for :func:`fit`.

    Raises
    ------
    InvalidError : if neither or both of ``tolerance`` and ``knots`` are given, or numbers do not fit.
    NoSolutionError : if the points do not determine the surface.
    """
    if (tolerance is None) == (knots is None):
        raise InvalidError("approximate: give a tolerance or knots, one of them")
    with_tolerance = {
        "topology": topology != "disk",
        "max_control_points": max_control_points is not None,
        "noise": noise is not None,
        "progress": progress is not None,
    }
    with_knots = {"weights": weights is not None, "periodic": periodic is not None, "smoothing": smoothing != 0.0}
    for name, given in (with_tolerance if tolerance is None else with_knots).items():
        if given:
            raise InvalidError(f"approximate: {name} does not go with {'knots' if tolerance is None else 'a tolerance'}")
    if tolerance is None:
        assert knots is not None
        surface, rms = _nurbskin.approximate_on(
            points,
            uv,
            knots[0],
            knots[1],
            degree=degree,
            periodic=periodic,
            weights=weights,
            smoothing=smoothing,
            size=size,
        )
        return Approximation(surface, rms, None, None, None, None)
    with told(progress) as callback:
        surface, residuals, weighed, sigma, not_met = _nurbskin.approximate(
            points,
            uv,
            tolerance,
            degree=degree,
            topology=topology,
            max_control_points=max_control_points,
            noise=noise,
            size=size,
            progress=callback,
        )
    rms = float((residuals**2).mean() ** 0.5)
    return Approximation(surface, rms, residuals, weighed, sigma, not_met)


def rarefy(
    grid: ArrayLike | Scan,
    rarefy: float | tuple[float, float] | str | None = None,
    *,
    tolerance: float | str | None = None,
    topology: Topology = "disk",
    degree: int | Sequence[int] = 3,
) -> Rarefaction:
    """Logical rarefaction: the lines of a dense grid that its shape needs (Pal & Ballav 2007, section 4.2).

    Parameters
    ----------
    grid : (m, n, 3) points, or an ordered scan; then ``grid`` below is ``scan.array``.
    rarefy : the angle in degrees by which a normal must have turned since the last kept line, for u and v or both; or
        ``"18x18"`` lines. The fewest lines within the tolerance where None.
    tolerance : largest distance, as in :func:`fit`, of any point, kept or discarded, from the surface through the kept ones with the
        parameters that are returned: ``interpolate(grid[np.ix_(kept.i, kept.j)], u=kept.u, v=kept.v)``.

    Returns
    -------
    Rarefaction : indices i of the lines ``grid[i, :]`` and j of the lines ``grid[:, j]`` to keep, and parameters.
    """
    unit = grid.unit if isinstance(grid, Scan) else "auto"
    found = _nurbskin.rarefy(grid_of(grid), rarefy=rarefy, tolerance=tolerance, topology=topology, degree=degree, unit=unit)
    return Rarefaction(*found)


def enrich(grid: ArrayLike | Scan, levels: int = 1, *, topology: Topology = "disk") -> NDArray[np.float64]:
    """A denser grid through the same points, by Catmull-Clark subdivision (Pal & Ballav 2007, section 4.1).

    ``enriched[2**levels * i, 2**levels * j]`` is ``grid[i, j]``, to the last bit. ``levels`` is 0 to 6. Of an ordered scan
    ``grid`` is ``scan.array``.
    """
    return _nurbskin.enrich(grid_of(grid), levels=levels, topology=topology)


def simulate(
    shape: str,
    *,
    points: int | None = None,
    noise: float = 0.0,
    outliers: float = 0.0,
    holes: int = 0,
    seed: int = 0,
    shuffled: bool = False,
    opening: bool = False,
    mesh: bool = False,
    unaligned: bool = False,
) -> Scan:
    """Scans a known shape with a virtual scanner; lengths in mm.

    The last seven shapes are bodies with handles, branches or sharp edges: clouds in random order, or meshes.

    Parameters
    ----------
    shape : pot, patch, face, handle, sphere, ellipsoid, torus, tube, saddle, blade, plane,
        double-torus, mug, hammer, drill, tee, bracket or knot.
    points : number of points; the paper's for its four objects, 20 000 for bodies, else 10 000, where None.
    noise : standard deviation along the normal.
    outliers : part of the points thrown far off, 0 to 0.5.
    holes : number of round holes without points.
    seed : of everything random.
    shuffled : whether the points are in random order.
    opening : whether a closed tube has a longitudinal opening, as the paper's handle.
    mesh : whether the scan of a body is a mesh, of about this number of points.
    unaligned : whether that mesh cuts the sharp edges of the body, instead of following them.
    """
    return _nurbskin.simulate(
        shape,
        points=points,
        noise=noise,
        outliers=outliers,
        holes=holes,
        seed=seed,
        shuffled=shuffled,
        opening=opening,
        mesh=mesh,
        unaligned=unaligned,
    )


__all__: Sequence[str] = [
    "approximate",
    "check",
    "convert",
    "deviation",
    "enrich",
    "fit",
    "info",
    "interpolate",
    "rarefy",
    "read",
    "read_cad",
    "simulate",
    "view",
]
