//! Work on all cores, whose results do not depend on the number of threads.

use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// Results of a light function that one task computes at least, so that sharing them out costs little beside them. A guard;
/// results do not depend on it.
const RUN: usize = 1 << 10;
/// The same where a result is only copied.
const RUN_OF_COPIES: usize = 1 << 14;

/// f of each number below `count`, in order.
pub fn each<T: Send>(count: usize, f: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    if count < 2 {
        return (0..count).map(f).collect();
    }
    (0..count).into_par_iter().map(f).collect()
}

/// The results of two functions, each on a core of its own if there is one.
pub fn both<A: Send, B: Send>(
    one: impl FnOnce() -> A + Send,
    two: impl FnOnce() -> B + Send,
) -> (A, B) {
    rayon::join(one, two)
}

/// [`each`] of a light function: few numbers stay on one core.
pub fn each_light<T: Send>(count: usize, f: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    if count <= RUN {
        return (0..count).map(f).collect();
    }
    let shared = (0..count).into_par_iter().with_min_len(RUN);
    shared.map(f).collect()
}

/// Hands `f` block after block of two lists, of `of_a` and `of_b` items, and the number of the block. Nothing for
/// blocks of no items.
pub fn pairs_of_blocks<A: Send, B: Send>(
    a: &mut [A],
    of_a: usize,
    b: &mut [B],
    of_b: usize,
    f: impl Fn(usize, &mut [A], &mut [B]) + Sync + Send,
) {
    if of_a == 0 || of_b == 0 {
        return;
    }
    a.par_chunks_mut(of_a)
        .zip(b.par_chunks_mut(of_b))
        .enumerate()
        .for_each(|(k, (a, b))| f(k, a, b));
}

/// No parent, for [`children_first`].
pub const ROOT: u32 = u32::MAX;
/// The subtrees of one task cost at most the total cost divided by this number; a more expensive leaf is a task of its own.
/// Count. Guard: this many tasks balance the load of the cores. Results do not depend on it.
const TASK_PARTS: u64 = 64;
/// Total cost below which one task does a whole forest. Multiplications; they take about half a millisecond.
/// Guard: smaller tasks cost more to start than they save.
const LEAST_SHARED_COST: u64 = 1 << 20;

/// Calls `f` for each node of a forest, after it has been called for its children. `parents` are numbers above that of the
/// node, or [`ROOT`]; `costs` tell how the work is shared out. `f` gets a number below `parents.len()` and something to
/// work with that `tools` made for this task; where it returns false, no node that waits for it is called, and the result
/// is false. O(nodes) beside the calls.
pub fn children_first<T>(
    parents: &[u32],
    costs: &[u64],
    tools: impl Fn() -> T + Sync,
    f: impl Fn(&mut T, usize) -> bool + Sync,
) -> bool {
    let mut whole = costs.to_vec();
    let mut children = vec![0_u32; parents.len()];
    for (s, &parent) in parents.iter().enumerate().filter(|p| *p.1 != ROOT) {
        whole[parent as usize] += whole[s];
        children[parent as usize] += 1;
    }
    let total: u64 = costs.iter().sum();
    if total < LEAST_SHARED_COST {
        let mut tools = tools();
        return (0..parents.len()).all(|s| f(&mut tools, s));
    }
    // Small subtrees are tasks, some of them together; what is above waits for its children.
    let most = total / TASK_PARTS;
    let mut task = vec![ROOT; parents.len()];
    let mut tasks: Vec<Vec<usize>> = Vec::new();
    let mut room = 0;
    for s in (0..parents.len()).rev() {
        let above = parents.get(s).filter(|p| **p != ROOT);
        task[s] = match above.map(|&p| task[p as usize]) {
            Some(same) if same != ROOT => same,
            _ if whole[s] > most && children[s] > 0 => continue,
            _ => {
                if tasks.is_empty() || whole[s] > room {
                    tasks.push(Vec::new());
                    room = most;
                }
                room = room.saturating_sub(whole[s]);
                u32::try_from(tasks.len() - 1).unwrap_or(ROOT)
            }
        };
        tasks[task[s] as usize].push(s);
    }
    let is_above = |s: u32| s != ROOT && task[s as usize] == ROOT;
    let waiting: Vec<AtomicU32> = children.into_iter().map(AtomicU32::new).collect();
    let failed = AtomicBool::new(false);
    tasks.par_iter().with_max_len(1).for_each(|members| {
        let mut tools = tools();
        let mut call = |s: usize| {
            let good = !failed.load(Ordering::Relaxed) && f(&mut tools, s);
            if !good {
                failed.store(true, Ordering::Relaxed);
            }
            good
        };
        // Collected from the top down.
        for &s in members.iter().rev() {
            if !call(s) {
                return;
            }
            // What waits for the last of its children is done with it.
            let mut done = s;
            while let Some(&above) = parents.get(done).filter(|p| is_above(**p)) {
                done = above as usize;
                if waiting[done].fetch_sub(1, Ordering::AcqRel) != 1 {
                    break;
                }
                if !call(done) {
                    return;
                }
            }
        }
    });
    !failed.into_inner()
}

/// The items at these places.
pub fn gather<T: Copy + Send + Sync>(items: &[T], places: &[u32]) -> Vec<T> {
    each(places.len(), |k| items[places[k] as usize])
}

/// What was found for each index of `order`, a permutation of 0.., in chunks of `size` (the last may have fewer), by
/// ascending index. O(n).
pub fn by_index<T: Copy + Send + Sync>(order: &[u32], chunks: &[Vec<T>], size: usize) -> Vec<T> {
    // Four bytes each are put here and there, and everything else is then written in a row, by all cores.
    let mut place = vec![0_u32; order.len()];
    for (at, &k) in (0_u32..).zip(order) {
        place[k as usize] = at;
    }
    let item = |&at: &u32| chunks[at as usize / size][at as usize % size];
    place
        .par_iter()
        .with_min_len(RUN_OF_COPIES)
        .map(item)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn children_come_first() {
        // Chains, stars, and a tree; costs that make one task, many, and nodes that are too large for any.
        let count = 2000_u32;
        let shapes: [&dyn Fn(u32) -> u32; 4] = [
            &|s| s + 1,
            &|_| count - 1,
            &|s| s + 1 + (s * 7919) % (count / 10),
            &|s| if s % 100 == 99 { ROOT } else { s + 1 },
        ];
        for shape in shapes {
            let parents: Vec<u32> = (0..count)
                .map(|s| {
                    Some(shape(s))
                        .filter(|p| *p < count && *p > s)
                        .unwrap_or(ROOT)
                })
                .collect();
            for cost in [1, 1000, 1 << 30] {
                let costs: Vec<u64> = (0..u64::from(count)).map(|s| cost * (1 + s % 3)).collect();
                let done: Vec<AtomicBool> =
                    parents.iter().map(|_| AtomicBool::new(false)).collect();
                let call = |s: usize, fail: usize| {
                    let below = parents[..s].iter().enumerate();
                    let mut children = below.filter(|c| *c.1 as usize == s);
                    assert!(children.all(|c| done[c.0].load(Ordering::Relaxed)));
                    assert!(!done[s].swap(true, Ordering::Relaxed), "called twice");
                    s != fail
                };
                assert!(children_first(
                    &parents,
                    &costs,
                    || (),
                    |(), s| call(s, usize::MAX)
                ));
                assert!(done.iter().all(|done| done.load(Ordering::Relaxed)));
                for done in &done {
                    done.store(false, Ordering::Relaxed);
                }
                let good = children_first(&parents, &costs, || (), |(), s| call(s, 700));
                let after = parents[700];
                assert!(!good && (after == ROOT || !done[after as usize].load(Ordering::Relaxed)));
            }
        }
        assert!(children_first(&[], &[], || (), |(), _| false));
    }

    #[test]
    fn any_permutation() {
        for n in [0, 1, 7, 100_003_u32] {
            // 7919 is a prime that divides none of them.
            let order: Vec<u32> = (0..u64::from(n))
                .filter_map(|k| u32::try_from(k * 7919 % u64::from(n)).ok())
                .collect();
            let chunks: Vec<Vec<u32>> = order.chunks(10).map(<[u32]>::to_vec).collect();
            let expected: Vec<u32> = (0..n).collect();
            assert_eq!(by_index(&order, &chunks, 10), expected);
        }
    }
}
