//! Values with a name, as the library has them.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use nurbskin::Unit;
use nurbskin::chart::Topology;
use nurbskin::fit::interpolate::parameters::Parameterization;
use nurbskin::pipeline::words::Worded;

// Names of their own, for clap takes an `Option` for an argument that may be missing.
pub(crate) type TopologyName = Option<Topology>;
pub(crate) type ParametersName = Option<Parameterization>;
pub(crate) type UnitName = Option<Unit>;

/// One of the words of an option.
pub(super) fn named<T: Worded + Send + Sync>() -> impl TypedValueParser<Value = T> {
    let known = T::WORDS.iter().map(|known| {
        let value = PossibleValue::new(known.word);
        match known.meaning {
            "" => value,
            meaning => value.help(meaning),
        }
    });
    PossibleValuesParser::new(known).try_map(|word| T::of_word(&word))
}
