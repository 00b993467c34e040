//! Logical rarefaction (Pal & Ballav 2007, section 4.2).
