//! Penalised least squares to scattered, parametrised points.
