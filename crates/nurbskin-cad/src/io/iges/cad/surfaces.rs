//! Surfaces: each entity as what faces lie on.

use super::super::directory::DirectoryEntry;
use super::super::surface;
use super::carrier::Carrier;
use super::entity::Reader;
use super::structure::name_of;
use super::{Got, leave, spline};
use crate::SurfaceKind;
use nurbskin_geometry::DVec3;
use nurbskin_geometry::math;
use nurbskin_geometry::nurbs::elementary;
use nurbskin_geometry::nurbs::elementary::{Frame, POLE_TO_POLE, TURN};
use nurbskin_geometry::nurbs::sweep::{extrude, over, ruled};
use nurbskin_geometry::nurbs::{KnotVector, NurbsCurve, NurbsSurface};
use std::f64::consts::{FRAC_PI_2, TAU};
use std::rc::Rc;

/// Entities that are surfaces.
pub(super) const SURFACES: [u32; 11] = [108, 114, 118, 120, 122, 128, 190, 192, 194, 196, 198];

impl Reader<'_> {
    /// The surface at a pointer, its own transformation applied.
    pub(super) fn carrier(&mut self, from: &DirectoryEntry, at: usize) -> Got<Rc<Carrier>> {
        let entry = self.entry(from, at, "surface")?;
        self.once(&entry, |this| &mut this.carriers, Self::read_carrier)
    }

    fn read_carrier(&mut self, entry: &Rc<DirectoryEntry>) -> Got<Rc<Carrier>> {
        let transform = self.store.transform(entry)?;
        let net = |surface, kind, own_parameters| Carrier::Net {
            surface,
            whole: None,
            kind,
            own_parameters,
        };
        let mut whole = None;
        let carrier = match entry.entity {
            128 => {
                let found = surface::read(&mut self.store.fields(entry)?)?;
                whole = found.whole;
                net(found.surface, SurfaceKind::BSpline, true)
            }
            114 => {
                let found = spline::read_surface(&mut self.store.fields(entry)?)?;
                net(found, SurfaceKind::ParametricSpline, true)
            }
            118 => net(self.ruled(entry)?, SurfaceKind::Ruled, true),
            120 => net(self.revolution(entry)?, SurfaceKind::Revolution, false),
            122 => net(self.tabulated(entry)?, SurfaceKind::Extrusion, true),
            108 => self.plane_by_equation(entry)?,
            190 | 192 | 194 | 196 | 198 => self.elementary(entry)?,
            other => {
                self.left.insert(entry.sequence);
                return leave(format!(
                    "it lies on a {}, which is not read",
                    name_of(other)
                ));
            }
        };
        let mut place = self.place();
        (place.transform, place.factor) = (transform, 1.0);
        let carrier = match carrier {
            Carrier::Net {
                ref surface, kind, ..
            } => {
                self.spend(surface.control_points().points().len())?;
                let own = matches!(
                    carrier,
                    Carrier::Net {
                        own_parameters: true,
                        ..
                    }
                );
                if let Some(whole) = &whole {
                    self.spend(whole.control_points().points().len())?;
                }
                let whole = whole.map(|whole| whole.map_points(|p| place.apply(p)));
                Carrier::Net {
                    surface: carrier.realise(place, &[])?,
                    whole: whole.transpose()?,
                    kind,
                    own_parameters: own,
                }
            }
            Carrier::Plane(frame) => Carrier::Plane(place.frame(&frame)),
            Carrier::Cylinder(frame, radius) => Carrier::Cylinder(place.frame(&frame), radius),
            Carrier::Cone(frame, radius, slope) => {
                Carrier::Cone(place.frame(&frame), radius, slope)
            }
        };
        Ok(Rc::new(carrier))
    }

    /// Entity 118: two curves, whether the second runs backwards, whether it is developable.
    fn ruled(&mut self, entry: &Rc<DirectoryEntry>) -> Got<NurbsSurface> {
        let mut fields = self.store.fields(entry)?;
        let [one, other] = [fields.pointer()?, fields.pointer()?];
        let backwards = fields.integer(0)? == 1;
        let mut rails = [self.rail(entry, one)?, self.rail(entry, other)?];
        if backwards {
            rails[1] = rails[1].reversed()?;
        }
        let even = |c: &NurbsCurve| c.knots().degree() == 1 && c.control_points().len() == 2;
        if entry.form == 0 && !rails.iter().all(even) {
            self.file.warnings.push(format!(
                "line {} (D{}): a surface ruled by arc length was read as ruled by parameters, which differs between \
                 the rails",
                entry.line, entry.sequence
            ));
        }
        Ok(ruled(&rails[0], &rails[1])?)
    }

    /// A curve, or a point (116), which a ruled surface may have in its place.
    fn rail(&mut self, from: &DirectoryEntry, at: usize) -> Got<NurbsCurve> {
        if self.store.entry(at).is_some_and(|e| e.entity == 116) {
            let point = self.point_at(from, at, 116)?;
            return Ok(NurbsCurve::new(
                KnotVector::uniform(1, 2)?,
                vec![point; 2],
                None,
            )?);
        }
        self.curve(from, at)
    }

    /// Entity 120: axis, generatrix, start and end angle. u runs along the generatrix, v around the axis.
    fn revolution(&mut self, entry: &Rc<DirectoryEntry>) -> Got<NurbsSurface> {
        let mut fields = self.store.fields(entry)?;
        let [axis, profile] = [fields.pointer()?, fields.pointer()?];
        let (start, end) = (fields.real(0.0)?, fields.real(TAU)?);
        let axis = self.curve(entry, axis)?;
        let profile = self.curve(entry, profile)?;
        let [Some(&from), Some(&to)] =
            [axis.control_points().first(), axis.control_points().last()]
        else {
            return leave("its axis has no points");
        };
        // A turn less rounding of the file's digits is a turn.
        let sweep = end - start;
        let sweep = if (sweep - TAU).abs() < 1e-9 {
            TAU
        } else {
            sweep
        };
        let frame = Frame::new(from, to - from, None)?;
        let surface = elementary::revolved(&frame, &profile, [start, start + sweep])?;
        Ok(surface.transposed())
    }

    /// Entity 122: directrix, and where the line that begins at its start ends.
    fn tabulated(&mut self, entry: &Rc<DirectoryEntry>) -> Got<NurbsSurface> {
        let mut fields = self.store.fields(entry)?;
        let directrix = fields.pointer()?;
        let end = DVec3::from_slice(&fields.reals(3, "end of the generatrix")?);
        let directrix = over(&self.curve(entry, directrix)?.clamped()?, (0.0, 1.0))?;
        let start = directrix.control_points().first().copied();
        Ok(extrude(&directrix, end - start.unwrap_or_default())?)
    }

    /// Entity 108 as an endless plane; the curve that may bound it is the business of [`Reader::plane_boundary`].
    fn plane_by_equation(&mut self, entry: &Rc<DirectoryEntry>) -> Got<Carrier> {
        let mut fields = self.store.fields(entry)?;
        let c = fields.reals(4, "plane")?;
        let boundary = fields.pointer()?;
        self.plane_boundaries.insert(entry.sequence, boundary);
        let normal = DVec3::from_slice(&c);
        let origin = normal * (c[3] / normal.length_squared());
        if !origin.is_finite() {
            return leave("its plane has no normal");
        }
        Ok(Carrier::Plane(Frame::new(origin, normal, None)?))
    }

    /// Entities 190 to 198: a place, directions and sizes; of form 1 with a reference direction.
    fn elementary(&mut self, entry: &Rc<DirectoryEntry>) -> Got<Carrier> {
        let mut fields = self.store.fields(entry)?;
        let location = fields.pointer()?;
        // The sphere has its radius before its axis, and of form 0 no axis.
        let sphere = entry.entity == 196;
        let first = if sphere { fields.real(0.0)? } else { 0.0 };
        let axis = if sphere && entry.form == 0 {
            0
        } else {
            fields.pointer()?
        };
        let sizes = match entry.entity {
            190 => vec![],
            192 => vec![fields.real(0.0)?],
            196 => vec![first],
            _ => vec![fields.real(0.0)?, fields.real(0.0)?],
        };
        let reference = if entry.form == 1 {
            fields.pointer()?
        } else {
            0
        };
        let origin = self.point_at(entry, location, 116)?;
        let axis = match axis {
            0 => DVec3::Z,
            at => self.point_at(entry, at, 123)?,
        };
        let reference = match reference {
            0 => None,
            at => Some(self.point_at(entry, at, 123)?),
        };
        let frame = Frame::new(origin, axis, reference)?;
        let closed = |surface, kind| Carrier::Net {
            surface,
            whole: None,
            kind,
            own_parameters: false,
        };
        Ok(match entry.entity {
            190 => Carrier::Plane(frame),
            192 if sizes[0] > 0.0 => Carrier::Cylinder(frame, sizes[0]),
            192 => return leave(format!("its radius is {}", sizes[0])),
            194 => {
                let (radius, angle) = (sizes[0], sizes[1].to_radians());
                if radius < 0.0 || angle.abs() >= FRAC_PI_2 || angle == 0.0 {
                    return leave(format!(
                        "no cone has the radius {radius} and the half angle {} degrees",
                        sizes[1]
                    ));
                }
                Carrier::Cone(frame, radius, math::tan(angle))
            }
            196 => closed(
                elementary::sphere(&frame, sizes[0], TURN, POLE_TO_POLE)?,
                SurfaceKind::Sphere,
            ),
            _ if sizes[0] <= sizes[1] => return leave("the torus meets itself"),
            _ => closed(
                elementary::torus(&frame, [sizes[0], sizes[1]], TURN, TURN)?,
                SurfaceKind::Torus,
            ),
        })
    }
}
