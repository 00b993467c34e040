//! Bodies with handles, branches and sharp edges, whose exact surface is known.
//!
//! A [`Body`] has no (u, v) over its whole surface, unlike a [`Shape`](super::Shape). Its surface is the zero level set
//! of an implicit function f, negative inside: a signed distance for the parts, and a smooth minimum where parts blend.
//! A [`BodySurface`] computes closest points on that set by Newton's method, and [`scan_body()`] makes clouds and meshes
//! whose points lie on it before noise is added. They serve as scans of known truth for networks of surfaces.
//!
//! | file | contents |
//! |---|---|
//! | `forms`, `recipes`, `knot`, `bracket` | the implicit functions |
//! | `surface`, `foot` | level, normals, closest points |
//! | `net`, `relax` | meshes with vertices on the surface |
//! | `scan` | clouds and meshes with noise, outliers and holes |

mod bracket;
mod bracket_mesh;
mod foot;
mod forms;
mod knot;
mod mesh;
mod net;
mod recipes;
mod relax;
mod scan;
mod surface;

pub use scan::{BodyOptions, Layout, SimulatedBody, scan_body};
pub use surface::BodySurface;

/// A body for the virtual scanner, in millimetres, around the point (300, 300, 300).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Body {
    /// Two blended rings side by side: smooth, genus 2.
    DoubleTorus,
    /// A cup with a wall of 8 mm, full-round rims and a handle: smooth, genus 1.
    Mug,
    /// A hammer: head, peen and handle with blends, genus 0.
    Hammer,
    /// A cordless drill: body, chuck, grip, battery foot and a guard before the grip, with blends, genus 1.
    Drill,
    /// A branch of two pipes, radii 20 and 14, with three open ends: a surface with three borders, genus 0.
    Tee,
    /// An L-shaped bracket with sharp edges and two through holes: planes and cylinders, genus 2.
    Bracket,
    /// A tube of radius 7 along a trefoil knot: smooth, genus 1.
    Knot,
}

impl Body {
    /// All bodies, in the order of the documentation.
    pub const ALL: [Body; 7] = [
        Body::DoubleTorus,
        Body::Mug,
        Body::Hammer,
        Body::Drill,
        Body::Tee,
        Body::Bracket,
        Body::Knot,
    ];

    /// The body's name on the command line: `double-torus`, `mug`, `hammer` ...
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Body::DoubleTorus => "double-torus",
            Body::Mug => "mug",
            Body::Hammer => "hammer",
            Body::Drill => "drill",
            Body::Tee => "tee",
            Body::Bracket => "bracket",
            Body::Knot => "knot",
        }
    }

    /// The body of this name, upper or lower case.
    ///
    /// ```
    /// use nurbskin_scan::simulate::Body;
    /// assert_eq!(Body::from_name("Double-Torus"), Some(Body::DoubleTorus));
    /// assert_eq!(Body::from_name("teapot"), None);
    /// ```
    #[must_use]
    pub fn from_name(name: &str) -> Option<Body> {
        Body::ALL
            .into_iter()
            .find(|body| body.name().eq_ignore_ascii_case(name))
    }

    /// Number of handles of the surface.
    #[must_use]
    pub fn genus(self) -> usize {
        match self {
            Body::Hammer | Body::Tee => 0,
            Body::Mug | Body::Drill | Body::Knot => 1,
            Body::DoubleTorus | Body::Bracket => 2,
        }
    }

    /// Number of borders: the open ends of the tee.
    #[must_use]
    pub fn borders(self) -> usize {
        if self == Body::Tee { 3 } else { 0 }
    }

    /// The Euler characteristic χ = 2 - 2 genus - borders.
    #[must_use]
    pub fn euler_characteristic(self) -> i64 {
        let [genus, borders] =
            [self.genus(), self.borders()].map(|n| i64::try_from(n).unwrap_or(0));
        2 - 2 * genus - borders
    }

    /// Whether the surface has sharp edges.
    #[must_use]
    pub fn has_creases(self) -> bool {
        self == Body::Bracket
    }
}

#[cfg(test)]
mod tests;
