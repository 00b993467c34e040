//! Loops in the parameter plane: crossings, sense, nesting.

use super::{Limit, Report, Severity, Subject, Worst};
use glam::DVec2;

pub(super) fn check(subject: &Subject, report: &mut Report) {
    let [mut crossed, mut turned, mut misplaced] = [Worst::default(); 3];
    for (k, face, region) in subject.faces() {
        let at = |place: DVec2| Some(face.surface.point(place.x, place.y));
        match region.crossings() {
            Ok(found) => found
                .into_iter()
                .for_each(|place| crossed.count(at(place), Some(k), None)),
            Err(why) => report
                .skipped
                .push(format!("crossings of the loops of face {}: {why}", k + 1)),
        }
        let start = |l: usize| face.loops[l].uses.first().map(|used| used.ends()[0]);
        for l in 0..face.loops.len() {
            let Some(from) = start(l) else { continue };
            let area = region.signed_area(l);
            if (area > 0.0) != (l == 0) {
                turned.count(at(from), Some(k), None);
            }
            // A hole is inside the outer loop and in no other hole.
            let depth = |m: usize| usize::from(m != l && region.loop_contains(m, from));
            let inside = depth(0);
            let others: usize = (1..face.loops.len()).map(depth).sum();
            if l > 0 && (inside != 1 || others > 0) || l == 0 && others > 0 {
                misplaced.count(at(from), Some(k), None);
            }
        }
    }
    let none = Limit::Most(0.0);
    report.add("loop_crossings", Severity::Defect, none, "", crossed);
    report.add("loop_orientation", Severity::Defect, none, "", turned);
    report.add("loop_nesting", Severity::Defect, none, "", misplaced);
}
