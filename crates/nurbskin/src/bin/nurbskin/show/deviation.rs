//! How far a scan is from a CAD file.

use super::{Show, measured, written};
use crate::failure::Result;
use nurbskin::pipeline::{Compared, Content};
use nurbskin::unit::{counted, percent, three_digits};

impl Show {
    /// The result of a comparison; `told` are warnings that were told while it ran.
    ///
    /// # Errors
    /// As [`print()`](super::print).
    pub(crate) fn compared(&self, compared: &Compared, told: &[String]) -> Result<()> {
        self.json(compared)?;
        let (input, unit) = (&compared.input, compared.input.unit);
        self.warnings(&compared.warnings, told);
        self.details(&compared.details);
        let mut page = self.page();
        measured::scan(&mut page, input);
        if let Content::Cad(cad) = &compared.cad.content {
            let size = compared.cad.bounding_box.map_or(String::new(), |corners| {
                format!(", {}", compared.cad.unit.size(measured::extents(corners)))
            });
            page.row(
                "nominal",
                &format!(
                    "{}: {}{size}",
                    compared.cad.path,
                    counted(cad.faces, "face", "faces")
                ),
            );
        }
        if let Some(aligned) = &compared.alignment {
            let [x, y, z] = aligned.translation;
            let moved = (x * x + y * y + z * z).sqrt();
            page.row(
                "aligned",
                &format!(
                    "turned by {} degrees, moved by {}; rms {} before, {} after",
                    three_digits(aligned.rotation_deg),
                    measured::length(unit, moved),
                    measured::length(unit, aligned.rms_before),
                    measured::length(unit, aligned.rms_after)
                ),
            );
        }
        measured::deviation(
            &mut page,
            &compared.deviation,
            compared.tolerance,
            compared.within,
            unit,
        );
        let edges = compared.deviation.free_edges.count;
        if edges > 0 {
            page.row(
                "",
                &format!(
                    "{} {} nearest to a free edge of the model",
                    counted(edges, "point", "points"),
                    if edges == 1 { "is" } else { "are" }
                ),
            );
        }
        let back = &compared.deviation.surface_to_scan;
        page.row(
            "coverage",
            &format!(
                "{} of the nominal area has scan data",
                percent(1.0 - back.unsupported_area)
            ),
        );
        if self.verbose {
            page.row(
                "",
                &format!(
                    "model to scan: 95 % of the area within {}, at most {}",
                    measured::length(unit, back.p95),
                    measured::length(unit, back.max)
                ),
            );
        }
        measured::verdict(
            &mut page,
            compared.verdict,
            &compared.reason,
            &compared.reasons,
            unit,
        );
        written(&mut page, &compared.outputs, Some(compared.time.total));
        self.result(page)
    }
}
