//! Which triangles meet at which side, and how the domain wraps round from one to the next.

/// No partner across a side: a border.
pub(super) const NONE: u32 = u32::MAX;

/// The sides of a triangle mesh: number 3 t + s runs from corner s of triangle t to the next corner.
#[derive(Clone, Debug)]
pub(super) struct Sides {
    /// The same side as the triangle across has it; [`NONE`] at borders.
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

/// The vertices that a side runs between.
pub(super) fn ends(triangles: &[[u32; 3]], side: u32) -> [u32; 2] {
    let (t, s) = (side as usize / 3, side as usize % 3);
    [triangles[t][s], triangles[t][(s + 1) % 3]]
}

/// What to add to a place when one goes along each side, in whole turns of u and v.
pub(super) type Jumps = Vec<[i8; 2]>;

/// Crosses `side` in this direction (0 = u, 1 = v): whoever goes along it, left to right as seen from its triangle's
/// path, gains `turns`.
pub(super) fn cross(jumps: &mut Jumps, partner: &[u32], side: u32, direction: usize, turns: i8) {
    let mine = &mut jumps[side as usize][direction];
    *mine = mine.saturating_add(turns);
    let other = partner[side as usize];
    if other != NONE {
        let theirs = &mut jumps[other as usize][direction];
        *theirs = theirs.saturating_sub(turns);
    }
}

/// The sides that a shortest path over triangles leaves through, from the triangle that holds side `from` to one
/// beside a side of which `is_goal` holds; the last one is that side. Triangles of which `closed` holds are not entered.
/// `None` if there is no way. O(n).
pub(super) fn path(
    partner: &[u32],
    from: &[u32],
    is_goal: impl Fn(u32) -> bool,
    closed: impl Fn(u32) -> bool,
) -> Option<Vec<u32>> {
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
                // Back to the start: sides as the triangle before has them.
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
