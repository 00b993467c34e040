//! Interpolation of an m x n grid (Pal & Ballav 2007, sections 3.2 and 3.3).
