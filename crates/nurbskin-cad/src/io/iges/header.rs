//! What stands before the entities of a file that is written: the start and the global section.

use super::card::CardWriter;
use super::global::{hollerith, unit_flag};
use super::number::push_real;
use super::write::{IgesContent, Layout, WriteOptions};
use crate::check::largest_gap;
use crate::io::text::Bounds;
use nurbskin_geometry::{Error, Result};

/// What the global section says about size and accuracy.
pub(super) struct Extent {
    pub(super) resolution: f64,
    maximum_coordinate: f64,
}

impl Extent {
    pub(super) fn of(content: &IgesContent<'_>, options: &WriteOptions) -> Result<Extent> {
        let nets = content
            .surfaces
            .iter()
            .flat_map(|s| s.control_points().points());
        let faces = content.model.iter().flat_map(|model| model.faces());
        let all = nets
            .chain(faces.flat_map(|face| face.surface.control_points().points()))
            .chain(content.points)
            .chain(content.polylines.iter().flatten());
        let bounds = Bounds::of(all, options.origin)?;
        let Some(bounds) = bounds.filter(|_| !content.polylines.iter().any(Vec::is_empty)) else {
            return Err(Error::invalid(
                "there is nothing to write: no surface, or a polyline without points",
            ));
        };
        let least = match options.layout {
            Layout::Exact => bounds.rounding(),
            Layout::Paper => 1e-6,
        };
        let gap = content.model.map_or(0.0, largest_gap);
        let resolution = bounds.resolution(options.resolution, least, gap)?;
        let maximum_coordinate = bounds.largest();
        Ok(Extent {
            resolution,
            maximum_coordinate,
        })
    }
}

/// The global section.
pub(super) fn global_cards(
    options: &WriteOptions,
    extent: &Extent,
    end_of_line: &'static str,
) -> CardWriter {
    // Short names keep the paper's layout at its count of cards.
    let name = |text: &str| match options.layout {
        Layout::Exact => hollerith(text),
        Layout::Paper => hollerith(&text.chars().take(24).collect::<String>()),
    };
    let real = |x: f64| {
        let mut text = String::new();
        push_real(&mut text, x);
        text
    };
    let version = env!("CARGO_PKG_VERSION");
    let (flag, unit) = unit_flag(options.unit);
    let date = hollerith(&options.timestamp.to_string());
    let parameters = [
        "1H,".to_owned(),
        "1H;".to_owned(),
        name(&options.product),
        name(&options.file_name),
        hollerith("nurbskin"),
        hollerith(&format!("nurbskin {version}")),
        // Bits of an integer; power of ten and digits of single and of double precision.
        "32".to_owned(),
        "38".to_owned(),
        "6".to_owned(),
        "308".to_owned(),
        "15".to_owned(),
        String::new(),   // product name for the receiver: the same
        "1.".to_owned(), // scale
        flag.to_string(),
        hollerith(unit),
        "1".to_owned(), // line weights
        real(extent.resolution),
        date.clone(),
        real(extent.resolution),
        real(extent.maximum_coordinate),
        name(&options.author),
        name(&options.organization),
        "11".to_owned(), // IGES 5.3
        "0".to_owned(),  // no drafting standard
        date,
        String::new(), // no application protocol
    ];
    let mut section = CardWriter::new('G', end_of_line);
    let last = parameters.len() - 1;
    for (k, parameter) in parameters.iter().enumerate() {
        section.token(&format!("{parameter}{}", if k == last { ';' } else { ',' }));
    }
    section.end_card();
    section
}

/// The start section, which is for people.
pub(super) fn start_cards(layout: Layout, global: usize, end_of_line: &'static str) -> CardWriter {
    let mut section = CardWriter::new('S', end_of_line);
    let mut card = |text: &str| {
        section.token(text);
        section.end_card();
    };
    card(concat!(
        "NURBS surface by nurbskin ",
        env!("CARGO_PKG_VERSION")
    ));
    if layout == Layout::Paper {
        let more = [
            "Numbers have six decimals: the layout of",
            "P. Pal and R. Ballav, Object shape reconstruction through NURBS surface",
            "interpolation, Int. J. Production Research 45(2), 2007",
        ];
        for text in more.iter().take(4usize.saturating_sub(global)) {
            card(text);
        }
    }
    section
}
