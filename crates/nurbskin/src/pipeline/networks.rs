//! Figures of networks of faces: their edges, and the angles between normals across them.
//!
//! The angles are certified bounds ([`nurbskin_cad::normal_jumps`]); the kinds of the edges are those of the fit.

use super::outcome::{Closed, EdgeCounts, FaceEdge, JumpFigures, SurfaceSummary};
use crate::surfacing::{FaceLayout, NetworkPart, PartShape, Surfaces};
use nurbskin_cad::{JoinKind, Meant, Model, normal_jumps};
use nurbskin_geometry::Result;

/// The summary of a network, from the figures `common` to all parts.
///
/// # Errors
/// [`Error::Invalid`](nurbskin_geometry::Error::Invalid) if the network makes no model.
pub(super) fn summary(part: &NetworkPart, common: SurfaceSummary) -> Result<SurfaceSummary> {
    let network = &part.network;
    let jumps = normal_jumps(&network.to_model("")?, Meant::Kinds(&network.kinds())).summary;
    let [smooth, sharp, border] = network.kind_counts();
    let count = network.control_point_count();
    let degree = network.faces.first().map(|face| face.surface.degree());
    Ok(SurfaceSummary {
        layout: FaceLayout::Network,
        topology: part.topology(),
        degree: degree.unwrap_or_default(),
        control_points: vec![count],
        closed: Closed::Network(network.is_closed()),
        faces: Some(network.faces.len()),
        control_points_total: Some(count),
        edges: Some(EdgeCounts {
            smooth,
            sharp,
            border,
        }),
        normal_jump: Some(JumpFigures {
            p95: jumps.p95,
            p99: jumps.p99,
            max: jumps.max,
            bound: jumps.bound,
            over_tenth: jumps.over_tenth,
            over_half: jumps.over_half,
        }),
        genus: Some(part.genus),
        borders: Some(part.borders),
        ..common
    })
}

/// The edges of all networks, by their index in the model.
pub(super) fn edges(fitted: &Surfaces, model: &Model) -> Vec<FaceEdge> {
    let mut edges = Vec::new();
    for (part, faces) in fitted.parts.iter().zip(fitted.faces()) {
        let PartShape::Network(part) = &part.shape else {
            continue;
        };
        let faces = model.faces().get(faces).unwrap_or_default();
        let used = faces
            .iter()
            .flat_map(|face| &face.loops)
            .flat_map(|l| &l.uses);
        // The edges of a network follow each other, in its order.
        let first = used.map(|used| used.edge).min().unwrap_or(0);
        let of = |(edge, k): (&nurbskin_cad::NetworkEdge, usize)| FaceEdge {
            edge: k,
            kind: edge.kind,
            jump: None,
        };
        edges.extend(part.network.edges.iter().zip(first..).map(of));
    }
    if edges.is_empty() {
        return edges;
    }
    let found = normal_jumps(model, Meant::Kinds(&kinds(&edges)));
    let mut jumps = vec![None; model.edges().len()];
    for jump in &found.edges {
        if let Some(place) = jumps.get_mut(jump.edge) {
            *place = Some(jump.reach());
        }
    }
    for edge in &mut edges {
        edge.jump = jumps.get(edge.edge).copied().flatten();
    }
    edges
}

/// The kinds of the edges of a model, for [`Meant::Kinds`]; edges of single surfaces are taken for smooth.
pub(super) fn kinds(edges: &[FaceEdge]) -> Vec<JoinKind> {
    let count = edges.iter().map(|edge| edge.edge + 1).max().unwrap_or(0);
    let mut kinds = vec![JoinKind::Smooth; count];
    for edge in edges {
        kinds[edge.edge] = edge.kind;
    }
    kinds
}
