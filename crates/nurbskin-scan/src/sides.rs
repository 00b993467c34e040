//! Sides of triangles: side 3t + s of triangle t runs from its corner s to the next one.

use nurbskin_geometry::numeric::bucket_sort::sort_by_key;

/// No side or triangle: what lies across a border. Guard: the largest index, which no mesh in memory reaches.
pub const NONE: u32 = u32::MAX;

/// The side before this one in its triangle.
pub(crate) fn before(side: u32) -> u32 {
    if side.is_multiple_of(3) {
        side + 2
    } else {
        side - 1
    }
}

/// The side after this one in its triangle.
pub(crate) fn after(side: u32) -> u32 {
    if side % 3 == 2 { side - 2 } else { side + 1 }
}

/// For each side the only other one between the same vertices, or [`NONE`]. O(n log n).
pub(crate) fn opposite_sides(triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut opposite = vec![NONE; 3 * triangles.len()];
    for group in sides_by_edge(triangles).chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        if let [x, y] = group {
            opposite[x.2 as usize] = y.2;
            opposite[y.2 as usize] = x.2;
        }
    }
    opposite
}

/// (smaller vertex, larger vertex, side) of all sides, sorted.
pub(crate) fn sides_by_edge(triangles: &[[u32; 3]]) -> Vec<(u32, u32, u32)> {
    let sides: Vec<(u32, u32, u32)> = (0_u32..)
        .zip(triangles.as_flattened())
        .map(|(side, &a)| {
            let b = triangles[side as usize / 3][after(side) as usize % 3];
            (a.min(b), a.max(b), side)
        })
        .collect();
    let ends = |side: &(u32, u32, u32)| u64::from(side.0) << 32 | u64::from(side.1);
    sort_by_key(sides, ends, Ord::cmp)
}
