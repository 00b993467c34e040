//! Catmull-Clark enrichment of sparse grids and meshes (Pal & Ballav 2007, section 4.1).
