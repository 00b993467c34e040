//! The product, its units and its representations (ISO 10303-41, -43 and -46).

use super::text::{Id, Text};
use super::topology::Item;
use super::{Schema, WriteOptions};
use crate::Model;
use nurbskin_geometry::{Result, Unit};

/// What others refer to.
pub(super) struct Product {
    /// The `PRODUCT_DEFINITION_SHAPE`.
    pub(super) shape: Id,
    /// Space: three coordinates, units and the uncertainty.
    pub(super) context: Id,
    /// The parameter planes of surfaces.
    pub(super) context_uv: Id,
    /// The unit of length.
    pub(super) length: Id,
}

/// The header section, and the start of the data section.
pub(super) fn header(text: &mut Text, model: &Model, options: &WriteOptions<'_>) {
    let version = concat!("nurbskin ", env!("CARGO_PKG_VERSION"));
    text.raw("ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((");
    text.string(&format!("Shape of {}", name_of(model, options)));
    text.raw("),'2;1');\nFILE_NAME(").string(&options.file_name);
    text.raw(",").string(&options.timestamp.iso());
    text.raw(",(").string(&options.author);
    text.raw("),(").string(&options.organization);
    text.raw("),").string(version).raw(",");
    text.string(version).raw(",'');\nFILE_SCHEMA((");
    text.string(match options.schema {
        Schema::Ap214 => "AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }",
        Schema::Ap242 => "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF { 1 0 10303 442 1 1 4 }",
    });
    text.raw("));\nENDSEC;\nDATA;\n");
}

fn name_of<'a>(model: &'a Model, options: &'a WriteOptions<'_>) -> &'a str {
    let names = [options.product.as_str(), model.name.as_str(), "part"];
    let given = names.into_iter().find(|name| !name.is_empty());
    given.unwrap_or_default()
}

/// The product with its contexts, units and uncertainty.
pub(super) fn definition(
    text: &mut Text,
    model: &Model,
    options: &WriteOptions<'_>,
    uncertainty: f64,
) -> Product {
    let (context, protocol) = match options.schema {
        Schema::Ap214 => (
            "core data for automotive mechanical design processes",
            "'automotive_design',2000,",
        ),
        Schema::Ap242 => (
            "managed model based 3d engineering",
            "'ap242_managed_model_based_3d_engineering',2014,",
        ),
    };
    let name = name_of(model, options);
    let application = text.add(|text| {
        text.raw("APPLICATION_CONTEXT(").string(context).raw(")");
    });
    text.add(|text| {
        text.raw("APPLICATION_PROTOCOL_DEFINITION('international standard',");
        text.raw(protocol).id(application).raw(")");
    });
    let of_product = text.add(|text| {
        text.raw("PRODUCT_CONTEXT('',")
            .id(application)
            .raw(",'mechanical')");
    });
    let product = text.add(|text| {
        text.raw("PRODUCT(").string(name).raw(",").string(name);
        text.raw(",'',").ids(&[of_product]).raw(")");
    });
    text.add(|text| {
        text.raw("PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,");
        text.ids(&[product]).raw(")");
    });
    let formation = text.add(|text| {
        text.raw("PRODUCT_DEFINITION_FORMATION('','',")
            .id(product)
            .raw(")");
    });
    let of_definition = text.add(|text| {
        text.raw("PRODUCT_DEFINITION_CONTEXT('part definition',");
        text.id(application).raw(",'design')");
    });
    let definition = text.add(|text| {
        text.raw("PRODUCT_DEFINITION('design','',").id(formation);
        text.raw(",").id(of_definition).raw(")");
    });
    let shape = text.add(|text| {
        text.raw("PRODUCT_DEFINITION_SHAPE('','',")
            .id(definition)
            .raw(")");
    });
    let length = length_unit(text, model.unit);
    let angle = text.add(|text| {
        text.raw("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))");
    });
    let solid_angle = text.add(|text| {
        text.raw("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())");
    });
    let uncertainty = text.add(|text| {
        text.raw("UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(")
            .real(uncertainty);
        text.raw("),")
            .id(length)
            .raw(",'distance_accuracy_value','confusion accuracy')");
    });
    let context = text.add(|text| {
        text.raw("(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(");
        text.ids(&[uncertainty])
            .raw(")GLOBAL_UNIT_ASSIGNED_CONTEXT(");
        text.ids(&[length, angle, solid_angle]);
        text.raw(")REPRESENTATION_CONTEXT('','3D'))");
    });
    let context_uv = text.add(|text| {
        text.raw("(GEOMETRIC_REPRESENTATION_CONTEXT(2)PARAMETRIC_REPRESENTATION_CONTEXT()");
        text.raw("REPRESENTATION_CONTEXT('','2D'))");
    });
    Product {
        shape,
        context,
        context_uv,
        length,
    }
}

/// A unit of length: of the SI with its prefix, or by its conversion to millimetres.
fn length_unit(text: &mut Text, unit: Unit) -> Id {
    let mut of_metre = |prefix: &str| {
        text.add(|text| {
            text.raw("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(")
                .raw(prefix)
                .raw(",.METRE.))");
        })
    };
    let name = match unit {
        Unit::Millimetre => return of_metre(".MILLI."),
        Unit::Centimetre => return of_metre(".CENTI."),
        Unit::Metre => return of_metre("$"),
        Unit::Micrometre => return of_metre(".MICRO."),
        Unit::Inch => "INCH",
        Unit::Foot => "FOOT",
    };
    let millimetre = of_metre(".MILLI.");
    let factor = text.add(|text| {
        text.raw("LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(")
            .real(unit.millimetres());
        text.raw("),").id(millimetre).raw(")");
    });
    let dimensions = text.add(|text| {
        text.raw("DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.)");
    });
    text.add(|text| {
        text.raw("(CONVERSION_BASED_UNIT(")
            .string(name)
            .raw(",")
            .id(factor);
        text.raw(")LENGTH_UNIT()NAMED_UNIT(")
            .id(dimensions)
            .raw("))");
    })
}

/// The representations of the shape: one for the solids, one for the sheets, one for the points, and one that they all
/// belong to where there are several; and the colour.
///
/// # Errors
/// [`Error::Invalid`](nurbskin_geometry::Error::Invalid) if the origin makes a point non-finite.
pub(super) fn representations(
    text: &mut Text,
    model: &Model,
    options: &WriteOptions<'_>,
    product: &Product,
    items: &[Item],
) -> Result<()> {
    let placement = placement(text);
    let context = product.context;
    let mut all = Vec::new();
    let mut represent = |text: &mut Text, kind: &str, items: &[Id]| {
        let id = text.add(|text| {
            text.raw(kind)
                .raw("('',")
                .list([&placement].into_iter().chain(items), |text, &id| {
                    text.id(id);
                });
            text.raw(",").id(context).raw(")");
        });
        all.push(id);
    };
    for (solid, kind) in [
        (true, "ADVANCED_BREP_SHAPE_REPRESENTATION"),
        (false, "MANIFOLD_SURFACE_SHAPE_REPRESENTATION"),
    ] {
        let alike = items.iter().filter(|item| item.solid == solid);
        let ids: Vec<Id> = alike.map(|item| item.id).collect();
        if !ids.is_empty() {
            represent(text, kind, &ids);
        }
    }
    if !options.points.is_empty() {
        let points = options.points.iter().map(|&p| text.point(p));
        let points = points.collect::<Result<Vec<_>>>()?;
        let set = text.add(|text| {
            text.raw("GEOMETRIC_SET('scan',").ids(&points).raw(")");
        });
        represent(
            text,
            "GEOMETRICALLY_BOUNDED_SURFACE_SHAPE_REPRESENTATION",
            &[set],
        );
    }
    let whole = match all[..] {
        [only] => only,
        _ => {
            let whole = text.add(|text| {
                text.raw("SHAPE_REPRESENTATION('',")
                    .ids(&[placement])
                    .raw(",");
                text.id(context).raw(")");
            });
            for part in all {
                text.add(|text| {
                    text.raw("SHAPE_REPRESENTATION_RELATIONSHIP('','',")
                        .id(whole);
                    text.raw(",").id(part).raw(")");
                });
            }
            whole
        }
    };
    text.add(|text| {
        text.raw("SHAPE_DEFINITION_REPRESENTATION(")
            .id(product.shape);
        text.raw(",").id(whole).raw(")");
    });
    if let Some(rgb) = model.colour {
        colour(text, rgb, product, items);
    }
    Ok(())
}

/// The coordinate system of the part. Its place is not moved by the origin.
fn placement(text: &mut Text) -> Id {
    let place = text.add(|text| {
        text.raw("CARTESIAN_POINT('',(0.,0.,0.))");
    });
    let [axis, x] = ["(0.,0.,1.)", "(1.,0.,0.)"].map(|ratios| {
        text.add(|text| {
            text.raw("DIRECTION('',").raw(ratios).raw(")");
        })
    });
    text.add(|text| {
        text.raw("AXIS2_PLACEMENT_3D('',")
            .id(place)
            .raw(",")
            .id(axis);
        text.raw(",").id(x).raw(")");
    })
}

/// One colour for both sides of all items.
fn colour(text: &mut Text, rgb: [u8; 3], product: &Product, items: &[Item]) {
    let colour = text.add(|text| {
        text.raw("COLOUR_RGB(''");
        for value in rgb {
            text.raw(",").real(f64::from(value) / 255.0);
        }
        text.raw(")");
    });
    let mut over = |before: &str, inner: Id, after: &str| {
        text.add(|text| {
            text.raw(before).id(inner).raw(after);
        })
    };
    let fill = over("FILL_AREA_STYLE_COLOUR('',", colour, ")");
    let area = over("FILL_AREA_STYLE('',(", fill, "))");
    let area = over("SURFACE_STYLE_FILL_AREA(", area, ")");
    let side = over("SURFACE_SIDE_STYLE('',(", area, "))");
    let usage = over("SURFACE_STYLE_USAGE(.BOTH.,", side, ")");
    let style = over("PRESENTATION_STYLE_ASSIGNMENT((", usage, "))");
    let styled = items.iter().map(|item| {
        text.add(|text| {
            text.raw("STYLED_ITEM('',").ids(&[style]).raw(",");
            text.id(item.id).raw(")");
        })
    });
    let styled: Vec<Id> = styled.collect();
    text.add(|text| {
        text.raw("MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',");
        text.ids(&styled).raw(",").id(product.context).raw(")");
    });
}
