//! Banded linear systems: LU without pivoting, plain and cyclic.
