//! Contour lines of values on a grid.

use glam::DVec2;

/// All closed contours at `level` of values on a grid of `count` nodes, u fastest, with the larger values to their left,
/// in units of nodes. Values on the border of the grid should be below the level: lines that end there are cut short.
/// O(nodes).
///
/// Source: marching squares, after W. Lorensen and H. Cline, *Marching cubes*, SIGGRAPH 1987, DOI 10.1145/37402.37422,
/// in two dimensions.
///
/// ```
/// use nurbskin_geometry::numeric::contours::{area, contours};
/// // A cone of height 4 over a grid of 11 x 11 nodes: at half its height a circle of radius 2.
/// let value = |k: usize| 4.0 - ((k % 11) as f64 - 5.0).hypot((k / 11) as f64 - 5.0);
/// let values: Vec<f64> = (0..121).map(value).collect();
/// let lines = contours(&values, [11, 11], 2.0);
/// assert_eq!(lines.len(), 1);
/// assert!((area(&lines[0]) / (4.0 * std::f64::consts::PI) - 1.0).abs() < 0.1);
/// ```
#[must_use]
pub fn contours(values: &[f64], count: [usize; 2], level: f64) -> Vec<Vec<DVec2>> {
    const NONE: usize = usize::MAX;
    let [m, n] = count;
    if m < 2 || n < 2 || values.len() != m * n {
        return Vec::new();
    }
    // The edge from node k to its right neighbour is number 2 k, to its upper one 2 k + 1.
    let mut next = vec![NONE; 2 * m * n];
    for j in 0..n - 1 {
        for i in 0..m - 1 {
            let k = j * m + i;
            let corners = [k, k + 1, k + m + 1, k + m].map(|k| values[k] > level);
            let edges = [2 * k, 2 * (k + 1) + 1, 2 * (k + m), 2 * k + 1];
            for (e, &edge) in edges.iter().enumerate() {
                if corners[e] && !corners[(e + 1) % 4] {
                    // Back along the corners that are inside, to the edge by which they were entered.
                    let run = (1..4).find(|r| !corners[(e + 4 - r) % 4]).unwrap_or(1);
                    next[edge] = edges[(e + 4 - run) % 4];
                }
            }
        }
    }
    let point = |edge: usize| {
        let k = edge / 2;
        let along_u = edge.is_multiple_of(2);
        let (a, b) = (values[k], values[if along_u { k + 1 } else { k + m }]);
        let t = (level - a) / (b - a);
        let start = DVec2::new((k % m) as f64, (k / m) as f64);
        start + t * if along_u { DVec2::X } else { DVec2::Y }
    };
    let mut lines = Vec::new();
    for start in 0..next.len() {
        let mut line = Vec::new();
        let mut edge = start;
        while next[edge] != NONE {
            line.push(point(edge));
            edge = std::mem::replace(&mut next[edge], NONE);
        }
        if line.len() > 2 {
            lines.push(line);
        }
    }
    lines
}

/// Area inside a polygon, positive if it is counter-clockwise.
#[must_use]
pub fn area(polygon: &[DVec2]) -> f64 {
    let next = polygon.iter().cycle().skip(1);
    let crosses = polygon.iter().zip(next).map(|(a, b)| a.perp_dot(*b));
    0.5 * crosses.sum::<f64>()
}
