//! Models that were stored, built anew by the way every other one is, so that none is unsound.

use super::{Edge, Face, Model, Shell};
use glam::DVec3;
use nurbskin_geometry::{Error, Result, Unit};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};

/// A model as it is stored, not yet checked.
#[derive(Deserialize)]
pub(super) struct Stored {
    name: String,
    unit: Unit,
    colour: Option<[u8; 3]>,
    vertices: Vec<DVec3>,
    edges: Vec<Edge>,
    faces: Vec<Face>,
    shells: Vec<Shell>,
    notes: Vec<String>,
    cut: BTreeMap<usize, usize>,
}

impl TryFrom<Stored> for Model {
    type Error = Error;

    fn try_from(stored: Stored) -> Result<Self> {
        let mut model = Self {
            name: stored.name,
            unit: stored.unit,
            colour: stored.colour,
            notes: stored.notes,
            ..Self::default()
        };
        for point in stored.vertices {
            model.add_vertex(point)?;
        }
        for edge in stored.edges {
            check_edge(&edge)?;
            model.push_edge(edge)?;
        }
        for face in stored.faces {
            model.add_face(face)?;
        }
        for shell in stored.shells {
            model.add_shell(shell)?;
        }
        check_cut(&stored.cut, model.edges.len())?;
        model.cut = stored.cut;
        Ok(model)
    }
}

/// What `add_edge` and `add_degenerate_edge` see to.
fn check_edge(edge: &Edge) -> Result<()> {
    let sound = match &edge.curve {
        Some(curve) => curve.knots().is_clamped() && !curve.knots().is_periodic(),
        None => edge.start == edge.end,
    };
    if sound {
        Ok(())
    } else {
        Err(Error::invalid(
            "the curve of an edge is not clamped, or a degenerate edge has two ends",
        ))
    }
}

/// Every chain of pieces must end: whoever follows one round a circle would never stop.
fn check_cut(cut: &BTreeMap<usize, usize>, edges: usize) -> Result<()> {
    let rest: BTreeSet<usize> = cut.values().copied().collect();
    let begins = cut.keys().filter(|edge| !rest.contains(edge));
    let follow = |edge: &usize| std::iter::successors(cut.get(edge), |at| cut.get(at)).count();
    let exists = cut.iter().all(|(a, b)| *a.max(b) < edges);
    // Where no two edges have the same next piece, only circles cannot be reached from where a chain begins.
    if exists && rest.len() == cut.len() && begins.map(follow).sum::<usize>() == cut.len() {
        Ok(())
    } else {
        Err(Error::invalid(
            "the pieces of an edge that was cut do not exist, or never end",
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    fn cut_plate() -> Model {
        let mut model = Model::new("plate");
        let ball = nurbskin_geometry::nurbs::conic::sphere(DVec3::X, 2.0).unwrap();
        let face = model.add_whole_surface(&ball, 1e-9).unwrap();
        model.add_shell_of(face).unwrap();
        let seam = (0..3).find(|&k| model.edges[k].curve.is_some()).unwrap();
        let (a, b) = model.edges[seam].curve.as_ref().unwrap().domain();
        model.cut_edge(seam, a + 0.3 * (b - a)).unwrap();
        model.cut_edge(seam, a + 0.1 * (b - a)).unwrap();
        model.notes.push("cut twice".into());
        model.colour = Some([1, 2, 255]);
        model
    }

    fn read(value: Value) -> std::result::Result<Model, serde_json::Error> {
        serde_json::from_value(value)
    }

    #[test]
    fn models_come_back() {
        let model = cut_plate();
        assert_eq!(read(json!(model)).unwrap(), model);
        assert_eq!(read(json!(Model::default())).unwrap(), Model::default());
    }

    /// One thing wrong at a time.
    #[test]
    fn unsound_models_are_refused() {
        let wrong = [
            ("/edges/0/start", json!(9)),
            ("/edges/0/curve", Value::Null),
            ("/edges/0/curve/knots/periodic", json!(true)),
            ("/faces/0/loops/0/uses/0/edge", json!(99)),
            ("/faces/0/loops/0/uses/1/reversed", json!(7)),
            ("/faces/0/loops/0/uses", json!([])),
            ("/faces/0/loops/0/uses/0/pcurve/knots/knots/0", json!(-1.0)),
            ("/faces/0/surface/weights/0", json!(0.0)),
            ("/faces/0/surface/knots_u/degree", json!(1)),
            ("/faces/0/surface/control_points/count_u", json!(2)),
            ("/shells/0/faces/0", json!(1)),
            ("/shells/0/faces", json!([0, 0])),
            ("/shells/0/kind", json!("closed?")),
            ("/cut", json!({"0": 1, "1": 0})),
            ("/cut", json!({"0": 2, "1": 2})),
            ("/cut", json!({"0": 99})),
        ];
        let model = json!(cut_plate());
        for (place, value) in wrong {
            let mut changed = model.clone();
            let Some(at) = changed.pointer_mut(place) else {
                panic!("{place} is not there: {model}");
            };
            *at = value;
            assert!(read(changed).is_err(), "{place}");
        }
    }
}
