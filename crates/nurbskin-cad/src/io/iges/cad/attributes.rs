//! Colours (entity 314) and names (entity 406, form 15).

use super::super::directory::DirectoryEntry;
use super::Got;
use super::entity::Reader;
use std::rc::Rc;

/// The colours that have numbers, 1 to 8.
const NUMBERED: [[u8; 3]; 8] = [
    [0, 0, 0],
    [255, 0, 0],
    [0, 255, 0],
    [0, 0, 255],
    [255, 255, 0],
    [255, 0, 255],
    [0, 255, 255],
    [255, 255, 255],
];

impl Reader<'_> {
    /// Keeps in mind the colour of a face.
    pub(super) fn see_colour(&mut self, entry: &DirectoryEntry) -> Got<()> {
        let colour = match usize::try_from(entry.colour.unsigned_abs()).unwrap_or(0) {
            0 => None,
            at if entry.colour < 0 => self.colour_at(entry, at)?,
            number => NUMBERED.get(number - 1).copied(),
        };
        self.face_colours.insert(colour);
        Ok(())
    }

    fn colour_at(&mut self, from: &DirectoryEntry, at: usize) -> Got<Option<[u8; 3]>> {
        let entry = self.entry(from, at, "colour")?;
        if entry.entity != 314 {
            return Ok(None);
        }
        let colour = self.once(
            &entry,
            |this| &mut this.colours,
            |this, entry| {
                let parts = this.store.fields(entry)?.reals(3, "colour")?;
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "clamped to 0..=255"
                )]
                let byte = |percent: f64| (percent * 2.55).round().clamp(0.0, 255.0) as u8;
                Ok([byte(parts[0]), byte(parts[1]), byte(parts[2])])
            },
        )?;
        Ok(Some(colour))
    }

    /// The name that one of these properties gives, else the label of the entity with its subscript.
    pub(super) fn name(&mut self, entry: &DirectoryEntry, properties: &[usize]) -> Got<String> {
        for &at in properties {
            let found = self.store.entry(at);
            let Some(property) = found.filter(|p| p.entity == 406 && p.form == 15) else {
                continue;
            };
            return self.once(
                &property,
                |this| &mut this.names,
                |this, entry: &Rc<DirectoryEntry>| {
                    let mut fields = this.store.fields(entry)?;
                    fields.integer(0)?; // how many values follow: the one name
                    Ok(fields.string()?)
                },
            );
        }
        Ok(entry.label.clone())
    }
}
