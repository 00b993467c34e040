//! Every figure and table of Pal & Ballav 2007.
