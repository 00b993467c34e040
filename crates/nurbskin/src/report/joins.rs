//! How the faces join at the edges of a model: the angle between their normals, for the colours of the edges.
//!
//! The angles are those of [`normal_jumps`]: bounds where the edge has one, else the largest of its samples.

use super::document::Join;
use super::number;
use glam::DVec3;
use nurbskin_cad::{EdgeJump, JoinKind, Meant, Model, normal_jumps};

/// The joins at these edges of the model, in their order. Without `kinds`, those of the edges of the model, edges with
/// small angles are smooth.
pub(super) fn joins(
    model: &Model,
    kinds: Option<&[JoinKind]>,
    edges: &[usize],
    origin: DVec3,
) -> Vec<Join> {
    let found = normal_jumps(model, kinds.map_or_else(Meant::default, Meant::Kinds));
    let mut faces: Vec<Vec<u32>> = vec![Vec::new(); model.edges().len()];
    for (k, face) in model.faces().iter().enumerate() {
        for used in face.loops.iter().flat_map(|l| &l.uses) {
            faces[used.edge].push(number(k));
        }
    }
    let of = |&edge: &usize| {
        let jump = found.edges.binary_search_by_key(&edge, |jump| jump.edge);
        let jump: Option<&EdgeJump> = jump.ok().and_then(|k| found.edges.get(k));
        let faces = faces.get(edge).cloned().unwrap_or_default();
        Join {
            edge,
            kind: match (jump, faces.len()) {
                (Some(jump), _) => Some(jump.kind),
                (None, 1) => Some(JoinKind::Open),
                (None, _) => None,
            },
            faces,
            sampled: jump.map(|jump| jump.sampled),
            bound: jump.and_then(|jump| jump.bound),
            length: jump.map(|jump| jump.length),
            place: jump.map(|jump| (jump.place + origin).to_array()),
        }
    };
    edges.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nurbskin_cad::samples::{block, disk_with_hole};

    #[test]
    fn the_edges_of_a_block_are_sharp_and_those_of_a_sheet_open() {
        let model = block(DVec3::ONE);
        let all: Vec<usize> = (0..model.edges().len()).collect();
        let origin = DVec3::X * 100.0;
        let found = joins(&model, None, &all, origin);
        assert_eq!(found.len(), 12);
        for (k, join) in found.iter().enumerate() {
            assert_eq!((join.edge, join.kind), (k, Some(JoinKind::Sharp)));
            assert_eq!(join.faces.len(), 2);
            assert!((join.sampled.unwrap() - 90.0).abs() < 1e-6);
            assert!(join.bound.is_none_or(|bound| bound >= 90.0 - 1e-9));
            let place = DVec3::from(join.place.unwrap()) - origin;
            let sides = place.to_array().into_iter();
            // On an edge two coordinates are those of sides.
            let on = sides.filter(|x| x.abs() < 1e-9 || (x - 1.0).abs() < 1e-9);
            assert!(on.count() >= 2, "{place}");
        }
        // Kinds that are known count more than angles.
        let smooth = vec![JoinKind::Smooth; 12];
        let found = joins(&model, Some(&smooth), &all, origin);
        assert!(found.iter().all(|join| join.kind == Some(JoinKind::Smooth)));
        let sheet = disk_with_hole([4.0, 1.0], [0.0, 1.0]);
        let all: Vec<usize> = (0..sheet.edges().len()).collect();
        let found = joins(&sheet, None, &all, DVec3::ZERO);
        assert!(!found.is_empty());
        for join in found {
            assert_eq!(join.kind, Some(JoinKind::Open));
            assert_eq!(
                (join.sampled, join.bound, join.faces.len()),
                (None, None, 1)
            );
        }
    }
}
