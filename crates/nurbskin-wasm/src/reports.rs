//! Reports in memory, as the command writes them to files.

use nurbskin::pipeline::PerPoint;
use nurbskin::{DVec3, Error, Result};
use std::path::PathBuf;

/// `html`, `csv` or `json` for the name of a report.
pub(crate) fn report_format(name: &str) -> Option<&'static str> {
    let extension = PathBuf::from(name)
        .extension()?
        .to_string_lossy()
        .to_lowercase();
    match extension.as_str() {
        "html" | "htm" => Some("html"),
        "csv" => Some("csv"),
        "json" => Some("json"),
        _ => None,
    }
}

/// The JSON of a result, as the command writes it to a file.
pub(crate) fn json(name: &str, result: &impl serde::Serialize) -> Result<Vec<u8>> {
    let text = serde_json::to_string_pretty(result);
    let text = text.map_err(|error| Error::write(name, error.to_string()))?;
    Ok(format!("{text}\n").into_bytes())
}

/// A line for each record of the file; `origin` is added to the points.
pub(crate) fn csv(name: &str, points: &PerPoint, origin: DVec3) -> Result<Vec<u8>> {
    let mut text = Vec::new();
    let written = points.write_csv(origin, &mut text);
    written.map_err(|error| Error::write(name, error.to_string()))?;
    Ok(text)
}
