"""Surfaces and scans that several tests use."""

import signal

import numpy as np
import pytest

import nurbskin

# A shell without job control starts what runs in its background deaf to Ctrl-C, and that is inherited.
signal.signal(signal.SIGINT, signal.default_int_handler)


def clamped(degree, breaks):
    """The clamped knot vector with these breakpoints."""
    return np.r_[[breaks[0]] * degree, breaks, [breaks[-1]] * degree].astype(float)


def height(u, v):
    """A gently waved sheet of 100 x 80."""
    return np.stack([100 * u, 80 * v, 6 * np.sin(5 * u) * np.cos(4 * v)], axis=-1)


@pytest.fixture
def sheet():
    """A grid of points on the sheet, u along the first axis, with its parameters."""
    u, v = np.linspace(0, 1, 23) ** 1.1, np.linspace(0, 1, 17)
    return height(*np.meshgrid(u, v, indexing="ij")), u, v


@pytest.fixture
def surface():
    """Any surface: degrees 3 and 2, knots of all kinds, no symmetry."""
    random = np.random.default_rng(5)
    u, v = clamped(3, [0, 0.2, 0.2, 0.7, 1]), clamped(2, [-1, 0.5, 2])
    net = np.stack([*np.meshgrid(np.arange(7.0), np.arange(4.0), indexing="ij"), np.zeros((7, 4))], axis=-1)
    return nurbskin.NurbsSurface(net + 0.3 * random.normal(size=net.shape), u, v, degree=(3, 2))


@pytest.fixture(scope="session")
def face():
    """A noisy scan of the paper's face, without order."""
    return nurbskin.simulate("face", points=4000, noise=0.05, shuffled=True)


@pytest.fixture(scope="session")
def fitted(face):
    return nurbskin.fit(face, tolerance=0.25)
