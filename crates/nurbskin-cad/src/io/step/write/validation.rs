//! Geometric validation properties: *Recommended Practices for Geometric and Assembly Validation Properties*, CAx-IF.

use super::Validation;
use super::product::Product;
use super::text::{Id, Text};
use nurbskin_geometry::{Error, Result};

/// Writes area, volume and centroid as properties of the shape.
///
/// # Errors
/// [`Error::Invalid`] if one is not finite.
pub(super) fn push(text: &mut Text, validation: &Validation, product: &Product) -> Result<()> {
    let Validation {
        area,
        volume,
        centroid,
    } = *validation;
    if !area.is_finite() || volume.is_some_and(|v| !v.is_finite()) {
        return Err(Error::invalid(format!(
            "an area of {area} and a volume of {volume:?} among the validation properties"
        )));
    }
    let mut measure = |item: &str, measure: &str, value: f64, power: f64| {
        let element = text.add(|text| {
            text.raw("DERIVED_UNIT_ELEMENT(")
                .id(product.length)
                .raw(",");
            text.real(power).raw(")");
        });
        let unit = text.add(|text| {
            text.raw("DERIVED_UNIT(").ids(&[element]).raw(")");
        });
        text.add(|text| {
            text.raw("MEASURE_REPRESENTATION_ITEM(")
                .string(item)
                .raw(",")
                .raw(measure);
            text.raw("(").real(value).raw("),").id(unit).raw(")");
        })
    };
    let mut values = vec![(
        "surface area",
        measure("surface area measure", "AREA_MEASURE", area, 2.0),
    )];
    if let Some(volume) = volume {
        values.push((
            "volume",
            measure("volume measure", "VOLUME_MEASURE", volume, 3.0),
        ));
    }
    let centre = text.named_point("centre point", centroid)?;
    values.push(("centroid", centre));
    for (name, value) in values {
        property(text, product, name, value);
    }
    Ok(())
}

fn property(text: &mut Text, product: &Product, name: &str, value: Id) {
    let property = text.add(|text| {
        text.raw("PROPERTY_DEFINITION('geometric validation property',")
            .string(name);
        text.raw(",").id(product.shape).raw(")");
    });
    let representation = text.add(|text| {
        text.raw("REPRESENTATION(")
            .string(name)
            .raw(",")
            .ids(&[value]);
        text.raw(",").id(product.context).raw(")");
    });
    text.add(|text| {
        text.raw("PROPERTY_DEFINITION_REPRESENTATION(")
            .id(property)
            .raw(",");
        text.id(representation).raw(")");
    });
}
