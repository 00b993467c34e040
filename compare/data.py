"""The same arrays for every peer, and an independent evaluation of B-splines."""
import numpy as np
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree


def height(x, y):
    """The analytic surface on which every grid point lies."""
    return (8 * np.sin(np.pi * x / 25) * np.cos(np.pi * y / 20) + 3 * np.sin(np.pi * (x + y) / 45)
            + 0.004 * (x - 50) ** 2)


def grid(m, n):
    """An m x n x 3 grid of about 100 x 80 mm: uneven spacing, lines that are not straight."""
    i, j = np.meshgrid(np.linspace(0, 1, m), np.linspace(0, 1, n), indexing="ij")
    s = i + 0.10 * np.sin(2 * np.pi * i) / np.pi
    t = j - 0.12 * np.sin(2 * np.pi * j) / np.pi
    x = 100 * s + 0.8 * np.sin(2 * np.pi * t)
    y = 80 * t + 0.6 * np.sin(2 * np.pi * s)
    return np.stack([x, y, height(x, y)], -1)


def chord_parameters(points):
    """Chord-length parameters along the first index, averaged over the second."""
    length = np.linalg.norm(np.diff(points, axis=0), axis=2)
    along = np.cumsum(length, axis=0)
    u = np.concatenate([[0.0], (along / along[-1]).mean(axis=1)])
    u[-1] = 1.0
    return u


def parameters(points):
    return chord_parameters(points), chord_parameters(points.transpose(1, 0, 2))


def averaged_knots(u, p=3):
    inner = [u[j:j + p].mean() for j in range(1, len(u) - p)]
    return np.concatenate([np.zeros(p + 1), inner, np.ones(p + 1)])


def tensor(tu, tv, c, u, v, p=3, q=3):
    """S on the grid u x v."""
    a = BSpline(tu, c, p)(np.clip(u, tu[p], tu[-p - 1]))
    return np.moveaxis(BSpline(tv, np.moveaxis(a, 1, 0), q)(np.clip(v, tv[q], tv[-q - 1])), 0, 1)


def pointwise(tu, tv, c, u, v, du=0, dv=0, p=3, q=3):
    """A derivative of S at each (u_k, v_k)."""
    for _ in range(du):
        c = p * np.diff(c, axis=0) / (tu[p + 1:-1] - tu[1:-p - 1])[:, None, None]
        tu, p = tu[1:-1], p - 1
    for _ in range(dv):
        c = q * np.diff(c, axis=1) / (tv[q + 1:-1] - tv[1:-q - 1])[None, :, None]
        tv, q = tv[1:-1], q - 1
    bu = BSpline.design_matrix(u, tu, p).tocsr()
    bv = BSpline.design_matrix(v, tv, q).tocsr()
    iu, iv = bu.indices.reshape(-1, p + 1), bv.indices.reshape(-1, q + 1)
    wu, wv = bu.data.reshape(-1, p + 1), bv.data.reshape(-1, q + 1)
    return np.einsum("ka,kb,kabd->kd", wu, wv, c[iu[:, :, None], iv[:, None, :]])


def wavy_surface():
    """The bicubic 30 x 30 surface of the deviation benchmark: single-valued, amplitude 8, wavelength 40 to 50."""
    from scipy.interpolate import make_interp_spline
    points = grid(30, 30)
    u, v = parameters(points)
    tu, tv = averaged_knots(u), averaged_knots(v)
    c = make_interp_spline(u, points, 3, t=tu).c
    c = make_interp_spline(v, c.transpose(1, 0, 2), 3, t=tv).c.transpose(1, 0, 2)
    return tu, tv, np.ascontiguousarray(c)


def queries(surface, count, seed=5):
    """Points near the surface (sigma 0.5), one tenth far (sigma 8), one tenth up to 3 beyond its ends in x."""
    rng = np.random.default_rng(seed)
    u, v = rng.random(count), rng.random(count)
    k = np.arange(count) % 10
    points = pointwise(*surface, u, v) + np.where(k == 3, 8.0, 0.5)[:, None] * rng.standard_normal((count, 3))
    edge = k == 7
    low = rng.random(edge.sum()) < 0.5
    beyond = 3 * rng.random(edge.sum())
    points[edge, 0] = np.where(low, -beyond, 100 + beyond)
    return points, {"near": (k != 3) & (k != 7), "far": k == 3, "edge": edge}


def reference_distance(surface, points, samples=2000, starts=8, rounds=100):
    """Smallest distance found from the best of many samples by damped Gauss-Newton steps kept inside the domain."""
    t = np.linspace(0, 1, samples)
    cloud = tensor(*surface, t, t).reshape(-1, 3)
    _, nearest = cKDTree(cloud, balanced_tree=False, compact_nodes=False).query(points, k=starts)
    best = np.full(len(points), np.inf)
    for start in range(starts):
        u, v = t[nearest[:, start] // samples].copy(), t[nearest[:, start] % samples].copy()
        d = np.linalg.norm(pointwise(*surface, u, v) - points, axis=1)
        damping = np.full(len(points), 1e-9)
        for _ in range(rounds):
            r = pointwise(*surface, u, v) - points
            su, sv = pointwise(*surface, u, v, 1, 0), pointwise(*surface, u, v, 0, 1)
            g, h = (su * r).sum(1), (sv * r).sum(1)
            hold_u = ((u <= 0) & (g > 0)) | ((u >= 1) & (g < 0))
            hold_v = ((v <= 0) & (h > 0)) | ((v >= 1) & (h < 0))
            a, c = (su * su).sum(1) * (1 + damping), (sv * sv).sum(1) * (1 + damping)
            b = np.where(hold_u | hold_v, 0.0, (su * sv).sum(1))
            det = np.maximum(a * c - b * b, 1e-14 * a * c)
            nu = np.clip(u - np.where(hold_u, 0, (c * g - b * h) / det), 0, 1)
            nv = np.clip(v - np.where(hold_v, 0, (a * h - b * g) / det), 0, 1)
            nd = np.linalg.norm(pointwise(*surface, nu, nv) - points, axis=1)
            better = nd <= d
            damping = np.where(better, np.maximum(damping / 10, 1e-12), np.maximum(damping * 10, 1e-4))
            u, v, d = np.where(better, nu, u), np.where(better, nv, v), np.where(better, nd, d)
        best = np.minimum(best, d)
    return best
