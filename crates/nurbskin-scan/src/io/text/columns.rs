//! Which column of a line is which coordinate.

use super::super::scan::unit_named;
use nurbskin_geometry::unit::Unit;

/// What the columns are: slots 0 to 2 are x, y, z and 3 to 5 the normal.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Columns {
    /// The slot of each column up to the last one needed.
    pub(super) slots: Vec<Option<u8>>,
    /// Whether there is a normal.
    pub(super) normal: bool,
    /// Whether names say what the normal is, or only its length of one.
    pub(super) named: bool,
    /// The unit that the names tell.
    pub(super) unit: Option<Unit>,
}

impl Columns {
    /// Columns in these places: three, or six with the normal.
    fn at(places: &[usize]) -> Self {
        let mut slots = vec![None; places.iter().max().map_or(0, |last| last + 1)];
        for (slot, &place) in (0..).zip(places) {
            slots[place] = Some(slot);
        }
        Columns {
            slots,
            normal: places.len() == 6,
            ..Columns::default()
        }
    }

    /// The columns that the names tell; `Ok(None)` if none of x, y, z is named, the missing one if only some are.
    pub(super) fn named(names: &[Vec<u8>]) -> Result<Option<Self>, char> {
        let mut places = [None; 6];
        let mut unit = None;
        for (column, name) in names.iter().enumerate() {
            if let Some((slot, of)) = slot_named(&String::from_utf8_lossy(name)) {
                places[slot].get_or_insert(column);
                unit = unit.or(of);
            }
        }
        let [Some(x), Some(y), Some(z)] = [places[0], places[1], places[2]] else {
            let missing = (0..3).find(|&slot| places[slot].is_none());
            return match missing {
                Some(slot) if places[..3].iter().any(Option::is_some) => Err(['x', 'y', 'z'][slot]),
                _ => Ok(None),
            };
        };
        let columns = match [places[3], places[4], places[5]] {
            [Some(a), Some(b), Some(c)] => Columns::at(&[x, y, z, a, b, c]),
            _ => Columns::at(&[x, y, z]),
        };
        Ok(Some(Columns {
            named: true,
            unit,
            ..columns
        }))
    }

    /// The first three columns of `count`, and, where there are six or more and columns 4 to 6 or the last three
    /// hold vectors of length one in all rows of the sample, the normal.
    pub(super) fn guessed(count: usize, sample: &[Vec<f64>]) -> Self {
        let unit_at = |start: usize| {
            let rows = || {
                let rows = sample.iter().filter_map(|row| row.get(start..start + 3));
                rows.map(|row| [row[0], row[1], row[2]])
            };
            rows().all(is_unit) && rows().any(|row| row.iter().any(|c| c.abs() > 0.0))
        };
        if count >= 6 {
            for start in [3, count - 3] {
                if unit_at(start) {
                    return Columns::at(&[0, 1, 2, start, start + 1, start + 2]);
                }
            }
        }
        Columns::at(&[0, 1, 2])
    }
}

/// Whether a vector has the length of one to two decimals, or is not known (zero or not finite).
pub(super) fn is_unit(v: [f64; 3]) -> bool {
    let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
    // Two decimals written: half of 0.01 in each component, and a margin of two.
    (length - 1.0).abs() < 0.02 || length == 0.0 || !length.is_finite()
}

/// The slot that a column of this name belongs to, and the unit in the name.
fn slot_named(name: &str) -> Option<(usize, Option<Unit>)> {
    let lower = name.trim_start_matches("//").to_lowercase();
    let mut words = lower
        .split(|c: char| !c.is_alphanumeric())
        .filter(|w| !w.is_empty());
    let mut axis = None;
    let mut normal = false;
    let mut unit = None;
    let mut indexed = false;
    for word in words.by_ref() {
        let (is_axis, of_normal) = match word {
            "x" | "y" | "z" => (word, false),
            "nx" | "ny" | "nz" | "normalx" | "normaly" | "normalz" => {
                (&word[word.len() - 1..], true)
            }
            // ParaView: Points:0, Normals:2.
            "0" if indexed => ("x", normal),
            "1" if indexed => ("y", normal),
            "2" if indexed => ("z", normal),
            "points" | "point" | "p" | "pos" | "position" | "coord" | "coords" | "coordinate"
            | "coordinates" | "vertex" => {
                indexed = true;
                continue;
            }
            "n" | "normal" | "normals" => {
                (indexed, normal) = (true, true);
                continue;
            }
            _ => {
                unit = Some(unit_named(word)?);
                continue;
            }
        };
        if axis.is_some() {
            return None;
        }
        axis = Some(is_axis);
        normal |= of_normal;
    }
    let slot = match axis? {
        "x" => 0,
        "y" => 1,
        _ => 2,
    };
    Some((slot + if normal { 3 } else { 0 }, unit))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(names: &str) -> Result<Option<Columns>, char> {
        let names: Vec<Vec<u8>> = names.split(',').map(|n| n.as_bytes().to_vec()).collect();
        Columns::named(&names)
    }

    #[test]
    fn names_in_any_order_and_spelling() {
        let columns = named("id,Z,nx,y [mm],x_mm,NY,nz").unwrap().unwrap();
        assert_eq!(
            columns.slots,
            [None, Some(2), Some(3), Some(1), Some(0), Some(4), Some(5)]
        );
        assert_eq!(columns.unit, Some(Unit::Millimetre));
        let columns = named("Normals:0,Normals:1,Normals:2,Points:0,Points:1,Points:2").unwrap();
        assert_eq!(columns.unwrap().slots[3..], [Some(0), Some(1), Some(2)]);
        let columns = named("//X,Y,Z,R,G,B").unwrap().unwrap();
        assert_eq!(columns.slots, [Some(0), Some(1), Some(2)]);
        assert!(!columns.normal);
        assert_eq!(named("a,b,c"), Ok(None));
        assert_eq!(named("x,y,depth"), Err('z'));
    }

    #[test]
    fn normals_are_told_by_their_length() {
        let row = |tail: [f64; 4]| [vec![9.0, 8.0, 7.0], tail.to_vec()].concat();
        let unit = [row([0.6, 0.8, 0.0, 5.0]), row([0.0, 0.0, -1.0, 5.0])];
        assert!(Columns::guessed(7, &unit).normal);
        let last = [row([5.0, 0.6, 0.8, 0.0])];
        assert_eq!(Columns::guessed(7, &last).slots[6], Some(5));
        assert!(!Columns::guessed(7, &[row([1.0, 2.0, 3.0, 4.0])]).normal);
        assert!(!Columns::guessed(5, &unit).normal);
    }
}
