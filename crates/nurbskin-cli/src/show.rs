//! What people see: a summary on stderr, progress on a terminal. Data goes to stdout as JSON.

use crate::args::Common;
use crate::describe;
use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};
use nurbskin::Unit;
use nurbskin::pipeline::{
    Checked, Compared, Content, DeviationSummary, Information, Outcome, Output, Viewed,
};
use nurbskin::progress::Progress;
use serde::Serialize;
use std::io::{ErrorKind, IsTerminal, Write};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Set by Ctrl-C.
static CANCELLED: AtomicBool = AtomicBool::new(false);
/// Set before files are written.
static WRITING: AtomicBool = AtomicBool::new(false);
/// Time for a computation to stop by itself.
const PATIENCE: Duration = Duration::from_millis(700);

/// Asks the running computation to stop, and stops the process if it does not do so soon. Files that are being written
/// are finished or removed first: whoever starts writing after this sees that it is cancelled.
#[expect(clippy::exit, reason = "the main thread does not listen")]
pub(crate) fn cancel() {
    CANCELLED.store(true, Ordering::SeqCst);
    std::thread::sleep(PATIENCE);
    if !WRITING.load(Ordering::SeqCst) {
        tell("nurbskin: cancelled");
        std::process::exit(i32::from(crate::ERROR));
    }
}

/// Where things are shown, and how much.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Show {
    json: bool,
    quiet: bool,
}

impl Show {
    pub(crate) fn new(common: &Common) -> Self {
        Self {
            json: common.json,
            quiet: common.quiet,
        }
    }

    pub(crate) fn error(&self, error: &(impl std::fmt::Display + ?Sized)) {
        tell(&format!("nurbskin: {error:#}"));
    }

    fn say(&self, text: &str) {
        if !self.quiet && !self.json {
            tell(text);
        }
    }

    /// One JSON object, where it is asked for.
    ///
    /// # Errors
    /// As [`print()`].
    pub(crate) fn json(&self, value: &impl Serialize) -> Result<()> {
        if self.json {
            let text = serde_json::to_string_pretty(value)?;
            print(&format!("{text}\n"))?;
        }
        Ok(())
    }

    /// The result of a verb that has nothing to judge.
    ///
    /// # Errors
    /// As [`print()`].
    pub(crate) fn done(&self, value: &impl Serialize, sentence: &str) -> Result<()> {
        self.json(value)?;
        self.say(sentence);
        Ok(())
    }

    /// What was fitted, how well, and where it went.
    ///
    /// # Errors
    /// As [`print()`].
    pub(crate) fn outcome(&self, outcome: &Outcome) -> Result<()> {
        self.json(outcome)?;
        let unit = outcome.input.unit;
        let input = &outcome.input;
        let rejected = &input.rejected;
        let lost = [
            (rejected.non_finite, "not finite"),
            (rejected.duplicate, "repeated"),
            (rejected.outlier, "outlying"),
        ];
        let lost: Vec<String> = lost
            .iter()
            .filter(|l| l.0 > 0)
            .map(|(n, why)| format!("{n} {why}"))
            .collect();
        let lost = if lost.is_empty() {
            String::new()
        } else {
            format!(", {} left out", lost.join(", "))
        };
        self.say(&format!(
            "scan        {}: {} points ({}){lost}; spacing {}, noise {}",
            input.path,
            input.points,
            input.organisation,
            measured(input.spacing, unit),
            measured(input.noise, unit)
        ));
        let surface = &outcome.surface;
        let [m, n] = surface.control_points;
        let kept = surface
            .kept
            .map_or(String::new(), |[a, b]| format!(", {a} x {b} lines kept"));
        self.say(&format!(
            "surface     {}, {m} x {n} control points, degree {} x {} ({}{kept})",
            surface.topology.name(),
            surface.degree[0],
            surface.degree[1],
            outcome.method
        ));
        self.both_ways(&outcome.deviation, outcome.tolerance, unit);
        self.warnings(&outcome.warnings);
        self.written(&outcome.outputs);
        if let Some(check) = &outcome.check {
            self.say(&format!("checked     {}", check.said));
        }
        self.say(&format!(
            "verdict     {}: {}  [{:.2} s]",
            outcome.verdict.name(),
            outcome.reason,
            outcome.time.total
        ));
        Ok(())
    }

    /// How far a scan is from a CAD file.
    ///
    /// # Errors
    /// As [`print()`].
    pub(crate) fn compared(&self, compared: &Compared) -> Result<()> {
        self.json(compared)?;
        let (input, unit) = (&compared.input, compared.input.unit);
        self.say(&format!(
            "scan        {}: {} points ({}); spacing {}, noise {}",
            input.path,
            input.points,
            input.organisation,
            measured(input.spacing, unit),
            measured(input.noise, unit)
        ));
        if let Content::Cad(cad) = &compared.cad.content {
            self.say(&format!(
                "CAD         {}: {} faces",
                compared.cad.path, cad.faces
            ));
        }
        if let Some(aligned) = &compared.alignment {
            let [x, y, z] = aligned.translation.map(short);
            self.say(&format!(
                "aligned     turned by {} degrees, moved by ({x}, {y}, {z}) {unit}; rms {} -> {} {unit}",
                short(aligned.rotation_deg),
                short(aligned.rms_before),
                short(aligned.rms_after)
            ));
        }
        self.both_ways(&compared.deviation, compared.tolerance, unit);
        let edges = compared.deviation.free_edges.count;
        if edges > 0 {
            self.say(&format!(
                "            {edges} points are nearest to a free edge"
            ));
        }
        self.warnings(&compared.warnings);
        self.written(&compared.outputs);
        self.say(&format!(
            "verdict     {}: {}  [{:.2} s]",
            compared.verdict.name(),
            compared.reason,
            compared.time.total
        ));
        Ok(())
    }

    fn both_ways(&self, deviation: &DeviationSummary, tolerance: Option<f64>, unit: Unit) {
        let d = &deviation.scan_to_surface;
        let within = match (d.within_tolerance, tolerance) {
            (Some(share), Some(tolerance)) => format!(
                "; {:.2} % of the points within {} {unit}",
                100.0 * share,
                short(tolerance)
            ),
            _ => String::new(),
        };
        self.say(&format!(
            "deviation   max {}, 95 % {}, rms {} {unit}{within}",
            short(d.max),
            short(d.p95),
            short(d.rms),
        ));
        let back = &deviation.surface_to_scan;
        self.say(&format!(
            "back        surface to scan 95 % {}, max {} {unit}; {:.2} % of the area has no data under it",
            short(back.p95),
            short(back.max),
            100.0 * back.unsupported_area
        ));
    }

    fn written(&self, outputs: &[Output]) {
        for output in outputs {
            self.say(&format!(
                "written     {} ({} bytes)",
                output.path.display(),
                output.bytes
            ));
        }
    }

    /// What is in a file: data, and so on stdout; what to mind on stderr.
    ///
    /// # Errors
    /// As [`print()`].
    pub(crate) fn information(&self, information: &Information) -> Result<()> {
        if self.json {
            return Ok(());
        }
        print(&describe::lines(information))?;
        for warning in &information.warnings {
            self.say(&format!("note        {}: {warning}", information.path));
        }
        Ok(())
    }

    /// The page of a file: opened, or its path on stdout.
    ///
    /// # Errors
    /// As [`print()`].
    pub(crate) fn viewed(&self, viewed: &Viewed, no_open: bool) -> Result<()> {
        let page = viewed.output.path.display();
        self.warnings(&viewed.input.warnings);
        if no_open {
            return if self.json {
                Ok(())
            } else {
                print(&format!("{page}\n"))
            };
        }
        match open::that_detached(&viewed.output.path) {
            Ok(()) => self.say(&format!("opened      {page}")),
            // The page is there all the same.
            Err(error) => tell(&format!(
                "nurbskin: no browser can be opened ({error}); open {page} yourself"
            )),
        }
        Ok(())
    }

    /// The checks of a CAD file: a table on stdout.
    ///
    /// # Errors
    /// As [`print()`].
    pub(crate) fn checked(&self, checked: &Checked) -> Result<()> {
        self.json(checked)?;
        if self.json {
            return Ok(());
        }
        print(&describe::checks(checked))?;
        self.warnings(&checked.warnings);
        Ok(())
    }

    /// What to mind.
    pub(crate) fn warnings(&self, warnings: &[String]) {
        for warning in warnings {
            self.say(&format!("note        {warning}"));
        }
    }

    /// One line for each of several scans.
    ///
    /// # Errors
    /// As [`print()`].
    pub(crate) fn table(&self, results: &[(&Path, Result<Outcome>)]) -> Result<()> {
        if self.json {
            let list: Vec<serde_json::Value> = results
                .iter()
                .map(|(path, result)| match result {
                    Ok(outcome) => serde_json::to_value(outcome).unwrap_or_default(),
                    Err(error) => {
                        serde_json::json!({ "input": { "path": path.display().to_string() }, "error": format!("{error:#}") })
                    }
                })
                .collect();
            return self.json(&serde_json::json!({ "scans": list }));
        }
        self.say(&format!(
            "{:40} {:>9} {:>14} {:>10} {:>10}  {}",
            "scan", "points", "control points", "95 %", "max", "verdict"
        ));
        for (path, result) in results {
            let name = path.display().to_string();
            match result {
                Ok(outcome) => {
                    let [m, n] = outcome.surface.control_points;
                    let d = &outcome.deviation.scan_to_surface;
                    self.say(&format!(
                        "{name:40} {:>9} {:>14} {:>10} {:>10}  {}",
                        outcome.input.points,
                        format!("{m} x {n}"),
                        short(d.p95),
                        short(d.max),
                        outcome.verdict.name()
                    ));
                }
                Err(_) => self.say(&format!(
                    "{name:40} {:>9} {:>14} {:>10} {:>10}  error",
                    "-", "-", "-", "-"
                )),
            }
        }
        Ok(())
    }
}

/// A line on stderr. Where nobody can read it, there is nobody to tell that.
fn tell(text: &str) {
    let _ = writeln!(anstream::stderr().lock(), "{text}");
}

/// Writes to stdout. A reader that has seen enough is no failure.
///
/// # Errors
/// What keeps stdout from taking it.
pub(crate) fn print(text: &str) -> Result<()> {
    let mut out = anstream::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(error).context("cannot write to standard output")
        }
        _ => Ok(()),
    }
}

/// A length that there may be too few points to tell.
fn measured(length: Option<f64>, unit: Unit) -> String {
    length.map_or("unknown".into(), |x| format!("{} {unit}", short(x)))
}

/// Three significant digits.
pub(crate) fn short(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    #[expect(clippy::cast_possible_truncation, reason = "the exponent of an f64")]
    let digits = 2 - x.abs().log10().floor() as i32;
    match usize::try_from(digits) {
        Ok(digits) if digits <= 7 => format!("{x:.digits$}"),
        Ok(_) => format!("{x:.2e}"),
        Err(_) => format!("{x:.0}"),
    }
}

/// A progress bar on stderr, on a terminal, for what takes longer than a second.
pub(crate) struct Terminal {
    bar: Option<ProgressBar>,
    start: Instant,
    quiet: bool,
    /// Warnings that came while the bar was up.
    warnings: Mutex<Vec<String>>,
}

impl Terminal {
    pub(crate) fn new(show: &Show) -> Self {
        let shown = !show.quiet && std::io::stderr().is_terminal();
        let bar = shown.then(|| {
            let bar = ProgressBar::no_length();
            bar.set_draw_target(indicatif::ProgressDrawTarget::hidden());
            bar
        });
        Self {
            bar,
            start: Instant::now(),
            quiet: show.quiet,
            warnings: Mutex::new(Vec::new()),
        }
    }

    /// Shows the bar once a second has passed.
    fn wake(&self) {
        let Some(bar) = &self.bar else { return };
        if bar.is_hidden() && self.start.elapsed() > Duration::from_secs(1) {
            bar.set_draw_target(indicatif::ProgressDrawTarget::stderr());
            bar.enable_steady_tick(Duration::from_millis(100));
        }
    }

    /// Removes the bar and prints what was to be said.
    pub(crate) fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
        if let Ok(mut warnings) = self.warnings.lock() {
            for warning in warnings.drain(..).filter(|_| !self.quiet) {
                tell(&format!("note        {warning}"));
            }
        }
    }
}

impl Progress for Terminal {
    fn stage(&self, name: &'static str, steps: Option<u64>) {
        WRITING.store(name == "write", Ordering::SeqCst);
        let Some(bar) = &self.bar else { return };
        let template = if steps.is_some() {
            "{msg:10} {bar:40} {pos}/{len} {elapsed}"
        } else {
            "{msg:10} {spinner} {elapsed}"
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        match steps {
            Some(steps) => bar.set_length(steps),
            None => bar.unset_length(),
        }
        bar.set_position(0);
        bar.set_message(name);
        self.wake();
    }
    fn advance(&self, steps: u64) {
        if let Some(bar) = &self.bar {
            bar.inc(steps);
            self.wake();
        }
    }
    fn warn(&self, message: &str) {
        if let Ok(mut warnings) = self.warnings.lock() {
            warnings.push(message.to_owned());
        }
    }
    fn cancelled(&self) -> bool {
        CANCELLED.load(Ordering::SeqCst)
    }
}
