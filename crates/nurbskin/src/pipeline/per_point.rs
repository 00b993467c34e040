//! The points of a result, each with its deviation.

use crate::deviation::measure::{PointDeviation, Statistics, Unused};
use crate::deviation::worst::worst;
use glam::DVec3;
use nurbskin_scan::{Reason, Records};
use serde::{Deserialize, Serialize};

/// A point far from the surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorstPoint {
    /// Its record in the file, as in [`PerPoint::records`].
    pub index: u32,
    /// The point, after the alignment if any.
    pub point: [f64; 3],
    /// Its signed deviation.
    pub deviation: f64,
}

/// Every used point with its deviation, in the order of the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PerPoint {
    /// Index of each point in the scan.
    pub indices: Vec<u32>,
    /// The points, minus the origin of the outcome.
    pub points: Vec<DVec3>,
    /// Their deviations.
    pub deviation: Vec<PointDeviation>,
    /// Which points were held out of the fit; empty if none were.
    pub held_out: Vec<bool>,
    /// Triangles between the points, as indices into this list, if the scan has any.
    pub triangles: Vec<[u32; 3]>,
    /// The points of the file that are not used, in the order of the file.
    pub unused: Vec<Unused>,
    /// Which records of the file hold the points of the scan; the others are empty cells of its range grid.
    pub records: Records,
}

impl PerPoint {
    /// The worst points; `origin` is the offset that was subtracted from the points.
    pub(super) fn worst(&self, origin: DVec3) -> Vec<WorstPoint> {
        let [low, high] = nurbskin_geometry::point_grid::bounding_box(&self.points);
        worst(&self.points, &self.deviation, low.distance(high))
            .into_iter()
            .map(|k| WorstPoint {
                index: self.records.of(self.indices[k]),
                point: (self.points[k] + origin).to_array(),
                deviation: self.deviation[k].signed(),
            })
            .collect()
    }

    /// The statistics of every finite point of the file, used or not; those `of_used` points where there are no others.
    pub(super) fn statistics_of_all(
        &self,
        of_used: Statistics,
        tolerance: Option<f64>,
    ) -> Statistics {
        let others = self.unused.iter().filter_map(|point| point.deviation);
        let mut others = others.peekable();
        if others.peek().is_none() {
            return of_used;
        }
        let all: Vec<PointDeviation> = self.deviation.iter().copied().chain(others).collect();
        Statistics::new(&all, tolerance)
    }

    /// One line per record of the file, in its order: index, x, y, z, deviation (signed), lower, upper, u, v, face,
    /// state. The index is the number of the record, from 0, as [`Records`] counts them. Coordinates are those of the
    /// file (after the alignment, if any), with `origin` added. The state is `used`, `held_out` of the fit, `outlier`,
    /// `left_out` with a part that has no surface, `duplicate` or `not_finite`; a point of the last state has no
    /// deviation. Empty cells of a range grid are `not_finite`, too, whatever their format writes for them; their
    /// coordinates are NaN.
    ///
    /// # Errors
    /// Errors of `out`.
    pub fn write_csv(&self, origin: DVec3, out: &mut dyn std::io::Write) -> std::io::Result<()> {
        writeln!(out, "index,x,y,z,deviation,lower,upper,u,v,face,state")?;
        let mut row = |index: u32, point: DVec3, d: Option<&PointDeviation>, state: &str| {
            let p = point + origin;
            write!(out, "{index},{},{},{},", p.x, p.y, p.z)?;
            if let Some(d) = d {
                let signed = d.signed();
                write!(
                    out,
                    "{signed},{},{},{},{},{}",
                    d.lower, d.upper, d.u, d.v, d.face
                )?;
            } else {
                write!(out, ",,,,,")?;
            }
            writeln!(out, ",{state}")
        };
        let mut empty = self.records.empty().peekable();
        let mut line = |point: u32, place: DVec3, d: Option<&PointDeviation>, state: &str| {
            let record = self.records.of(point);
            while let Some(cell) = empty.next_if(|cell| *cell < record) {
                row(cell, DVec3::NAN, None, state_of(Reason::NonFinite))?;
            }
            row(record, place, d, state)
        };
        let mut others = self.unused.iter().peekable();
        let rows = self.indices.iter().zip(&self.points).zip(&self.deviation);
        for (k, ((&index, &point), d)) in rows.enumerate() {
            while let Some(other) = others.next_if(|other| other.index < index) {
                let state = state_of(other.reason);
                line(other.index, other.point, other.deviation.as_ref(), state)?;
            }
            let held_out = self.held_out.get(k) == Some(&true);
            line(
                index,
                point,
                Some(d),
                if held_out { "held_out" } else { "used" },
            )?;
        }
        for other in others {
            let state = state_of(other.reason);
            line(other.index, other.point, other.deviation.as_ref(), state)?;
        }
        for cell in empty {
            row(cell, DVec3::NAN, None, state_of(Reason::NonFinite))?;
        }
        Ok(())
    }
}

/// The word for a point that is not used.
fn state_of(reason: Reason) -> &'static str {
    match reason {
        Reason::NonFinite => "not_finite",
        Reason::Duplicate => "duplicate",
        Reason::Outlier => "outlier",
        Reason::LeftOut => "left_out",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deviation::measure::Place;

    fn away(distance: f64, place: Place) -> PointDeviation {
        PointDeviation {
            lower: distance.abs(),
            upper: distance.abs(),
            side: distance.signum(),
            u: 0.25,
            v: 0.5,
            face: 3,
            place,
        }
    }

    /// Seven points of a file: three used, one for each reason why others are not.
    fn seven() -> PerPoint {
        let unused = |index, reason, deviation| Unused {
            index,
            point: DVec3::new(f64::from(index), 0.0, 0.0),
            reason,
            deviation,
        };
        let mut this = PerPoint {
            indices: vec![1, 3, 4],
            points: [1.0, 3.0, 4.0].map(|x| DVec3::X * x).to_vec(),
            deviation: vec![
                away(0.5, Place::Interior),
                away(-0.25, Place::FreeEdge),
                away(0.125, Place::Interior),
            ],
            held_out: vec![false, false, true],
            triangles: Vec::new(),
            unused: vec![
                unused(0, Reason::NonFinite, None),
                unused(2, Reason::Duplicate, Some(away(0.5, Place::Interior))),
                unused(5, Reason::Outlier, Some(away(-9.0, Place::Interior))),
                unused(6, Reason::LeftOut, Some(away(70.0, Place::FreeEdge))),
            ],
            records: Records::default(),
        };
        this.unused[0].point.y = f64::NAN;
        this
    }

    #[test]
    fn every_point_has_a_line_with_its_state() {
        let mut text = Vec::new();
        seven().write_csv(DVec3::Z, &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        let expected = "\
index,x,y,z,deviation,lower,upper,u,v,face,state
0,0,NaN,1,,,,,,,not_finite
1,1,0,1,0.5,0.5,0.5,0.25,0.5,3,used
2,2,0,1,0.5,0.5,0.5,0.25,0.5,3,duplicate
3,3,0,1,-0.25,0.25,0.25,0.25,0.5,3,used
4,4,0,1,0.125,0.125,0.125,0.25,0.5,3,held_out
5,5,0,1,-9,9,9,0.25,0.5,3,outlier
6,6,0,1,70,70,70,0.25,0.5,3,left_out
";
        assert_eq!(text, expected);
        let columns = |line: &str| line.split(',').count();
        assert!(text.lines().all(|line| columns(line) == 11));
    }

    #[test]
    fn indices_are_those_of_the_records() {
        let mut points = seven();
        points.records = Records::new(vec![1, 2, 3, 6, 7, 8, 9], 11).unwrap();
        let mut text = Vec::new();
        points.write_csv(DVec3::Z, &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        let lines: Vec<&str> = text.lines().skip(1).collect();
        let first = |line: &&str| line.split(',').next().unwrap().parse::<usize>().unwrap();
        assert!(lines.iter().map(first).eq(0..11));
        for cell in [0, 4, 5, 10] {
            assert_eq!(lines[cell], format!("{cell},NaN,NaN,NaN,,,,,,,not_finite"));
        }
        assert_eq!(lines[2], "2,1,0,1,0.5,0.5,0.5,0.25,0.5,3,used");
        assert_eq!(lines[9], "9,6,0,1,70,70,70,0.25,0.5,3,left_out");
        let worst: Vec<u32> = points.worst(DVec3::ZERO).iter().map(|w| w.index).collect();
        assert_eq!(worst, [2, 6, 7]);
    }

    #[test]
    fn figures_of_all_points_include_those_not_used() {
        let mut points = seven();
        let used = Statistics::new(&points.deviation, 0.3);
        assert_eq!(
            (used.above_tolerance, used.below_tolerance),
            (Some(1), Some(0))
        );
        let all = points.statistics_of_all(used, Some(0.3));
        assert_eq!((all.count, used.count), (6, 3));
        assert!((all.max - 70.0).abs() < 1e-12 && (used.max - 0.5).abs() < 1e-12);
        assert_eq!(
            (all.above_tolerance, all.below_tolerance),
            (Some(3), Some(1))
        );
        points.unused.truncate(1);
        assert_eq!(points.statistics_of_all(used, Some(0.3)), used);
    }

    #[test]
    fn points_count_for_the_face_of_their_foot_point() {
        let mut points = seven().deviation;
        points[1].face = 0;
        points[2].face = 9;
        let found = Statistics::by_face(&points, 4, Some(0.3));
        let counts: Vec<usize> = found.iter().map(|s| s.count).collect();
        // A face that does not exist has no figures.
        assert_eq!(counts, [1, 0, 0, 1]);
        assert!((found[0].signed_mean + 0.25).abs() < 1e-12);
        assert_eq!(found[1], Statistics::default());
        assert_eq!(found[3].above_tolerance, Some(1));
    }
}
