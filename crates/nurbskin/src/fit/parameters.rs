//! Parameter values and averaged knots for interpolation (Pal & Ballav 2007, eqs. (7)-(9)).
