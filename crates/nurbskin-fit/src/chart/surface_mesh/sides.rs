//! Sides of triangles, and how the domain wraps round from one triangle to the next.
//!
//! Side 3 t + s runs from corner s of triangle t to the next corner; its partner is the same edge as the triangle
//! across has it. Jumps store, per side, the whole turns of (u, v) that are added along it, with opposite signs on
//! partners. Their sum around each triangle is zero, and around a handle or an opening it is the period.
//!
//! Source: closed one-forms on meshes (Gortler, Gotsman and Thurston 2006).

/// Partner of a side on a border. Derived: the largest index, which no side of a mesh has.
pub(super) const NONE: u32 = u32::MAX;

/// The sides of a triangle mesh: number 3 t + s runs from corner s of triangle t to the next corner.
#[derive(Clone, Debug)]
pub(super) struct Sides {
    /// The same edge as a side of the triangle across; [`NONE`] at borders.
    pub(super) partner: Vec<u32>,
    /// One side of each edge.
    pub(super) edges: Vec<u32>,
}

impl Sides {
    /// O(n log n).
    pub(super) fn new(triangles: &[[u32; 3]]) -> Self {
        let mut keyed: Vec<(u64, u32)> = Vec::with_capacity(3 * triangles.len());
        for (t, f) in (0_u32..).zip(triangles) {
            for s in 0..3_u32 {
                let (a, b) = (f[s as usize], f[(s as usize + 1) % 3]);
                keyed.push(((u64::from(a.min(b)) << 32) | u64::from(a.max(b)), 3 * t + s));
            }
        }
        keyed.sort_unstable();
        let mut partner = vec![NONE; keyed.len()];
        let mut edges = Vec::with_capacity(keyed.len() / 2 + 1);
        for same in keyed.chunk_by(|x, y| x.0 == y.0) {
            edges.push(same[0].1);
            if let [x, y] = same {
                partner[x.1 as usize] = y.1;
                partner[y.1 as usize] = x.1;
            }
        }
        Self { partner, edges }
    }
}

/// The two vertices of a side.
pub(super) fn ends(triangles: &[[u32; 3]], side: u32) -> [u32; 2] {
    let (t, s) = (side as usize / 3, side as usize % 3);
    [triangles[t][s], triangles[t][(s + 1) % 3]]
}

/// Whole turns of u and v that are added along each side.
pub(super) type Jumps = Vec<[i8; 2]>;

/// Lets a cut cross `side`: adds `turns` to the jump along it in this direction (0 = u, 1 = v), and subtracts them on
/// its partner.
pub(super) fn cross(jumps: &mut Jumps, partner: &[u32], side: u32, direction: usize, turns: i8) {
    let mine = &mut jumps[side as usize][direction];
    *mine = mine.saturating_add(turns);
    let other = partner[side as usize];
    if other != NONE {
        let theirs = &mut jumps[other as usize][direction];
        *theirs = theirs.saturating_sub(turns);
    }
}

/// The sides through which a shortest path of triangles leaves each of them, from a triangle with a side in `from` to a
/// side for which `is_goal` holds, which is the last one. The path avoids triangles for which `closed` holds. `None` if
/// there is no path. O(n).
pub(super) fn path(
    partner: &[u32],
    from: &[u32],
    is_goal: impl Fn(u32) -> bool,
    closed: impl Fn(u32) -> bool,
) -> Option<Vec<u32>> {
    /// Entry of a triangle that the search has not reached. Derived: the largest index, which no side of a mesh has.
    const UNSEEN: u32 = u32::MAX;
    // The side through which each triangle was entered.
    let mut entered = vec![UNSEEN; partner.len() / 3];
    let mut queue = std::collections::VecDeque::new();
    for &side in from {
        if entered[side as usize / 3] == UNSEEN && !closed(side / 3) {
            entered[side as usize / 3] = side;
            queue.push_back(side / 3);
        }
    }
    while let Some(t) = queue.pop_front() {
        for side in 3 * t..3 * t + 3 {
            if side == entered[t as usize] {
                continue;
            }
            if is_goal(side) {
                let mut way = vec![side];
                let mut at = t;
                // Back to the start, with each side as the triangle before has it.
                loop {
                    let door = entered[at as usize];
                    if from.contains(&door) {
                        way.push(door);
                        break;
                    }
                    let before = partner[door as usize];
                    way.push(before);
                    at = before / 3;
                }
                way.reverse();
                return Some(way);
            }
            let other = partner[side as usize];
            if other != NONE && entered[other as usize / 3] == UNSEEN && !closed(other / 3) {
                entered[other as usize / 3] = other;
                queue.push_back(other / 3);
            }
        }
    }
    None
}
