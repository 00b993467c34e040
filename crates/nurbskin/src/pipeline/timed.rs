//! Time of each stage, derived from the progress messages.
//!
//! The stages announce themselves to a [`Progress`]. The wrapper here forwards all messages and assigns the time
//! between two announcements to the earlier stage. `web_time` is the standard library's clock, and that of the browser
//! where the standard library has none.

use super::outcome::Times;
use nurbskin_geometry::progress::Progress;
use std::sync::{Mutex, PoisonError};
use web_time::Instant;

/// A [`Progress`] that forwards all messages and accumulates the time of each stage.
pub(super) struct Timed<'a> {
    told: &'a dyn Progress,
    start: Instant,
    clock: Mutex<Clock>,
}

struct Clock {
    times: Times,
    /// The current stage, if it is timed, and its start.
    stage: Option<(&'static str, Instant)>,
}

impl Clock {
    /// Ends the current stage.
    fn end(&mut self) {
        let Some((name, since)) = self.stage.take() else {
            return;
        };
        if let Some(time) = time_of(&mut self.times, name) {
            *time += since.elapsed().as_secs_f64();
        }
    }
}

/// The entry for a stage; `None` for a nested stage.
fn time_of<'t>(times: &'t mut Times, name: &str) -> Option<&'t mut f64> {
    Some(match name {
        "read" => &mut times.read,
        "clean" => &mut times.clean,
        "order" => &mut times.order,
        "align" => &mut times.align,
        "rarefy" => &mut times.rarefy,
        "enrich" => &mut times.enrich,
        "fit" => &mut times.fit,
        "deviation" => &mut times.deviation,
        "write" => &mut times.write,
        _ => return None,
    })
}

impl<'a> Timed<'a> {
    pub(super) fn new(told: &'a dyn Progress) -> Self {
        Self {
            told,
            start: Instant::now(),
            clock: Mutex::new(Clock {
                times: Times::default(),
                stage: None,
            }),
        }
    }

    /// The times so far.
    pub(super) fn times(&self) -> Times {
        let mut clock = self.clock.lock().unwrap_or_else(PoisonError::into_inner);
        clock.end();
        Times {
            total: self.start.elapsed().as_secs_f64(),
            ..clock.times
        }
    }
}

impl Progress for Timed<'_> {
    fn stage(&self, name: &'static str, steps: Option<u64>) {
        let mut clock = self.clock.lock().unwrap_or_else(PoisonError::into_inner);
        if time_of(&mut Times::default(), name).is_some() {
            clock.end();
            clock.stage = Some((name, Instant::now()));
        }
        drop(clock);
        self.told.stage(name, steps);
    }

    fn advance(&self, steps: u64) {
        self.told.advance(steps);
    }

    fn tell(&self, so_far: &str) {
        self.told.tell(so_far);
    }

    fn warn(&self, message: &str) {
        self.told.warn(message);
    }

    fn cancelled(&self) -> bool {
        self.told.cancelled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::{InputOptions, Options, OutputOptions, Source, fit_from};
    use nurbskin_geometry::progress::Silent;

    #[test]
    fn each_stage_has_its_time_and_all_of_them_the_total() {
        let timed = Timed::new(&Silent);
        for stage in ["read", "fit", "approximate", "write", "fit"] {
            timed.stage(stage, None);
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        let times = timed.times();
        // A nested stage counts for the enclosing one.
        assert!(times.fit > 2.0 * times.read && times.read > 0.0 && times.write > 0.0);
        let sum = times.read + times.fit + times.write;
        assert!(sum <= times.total && times.order == 0.0);
    }

    #[test]
    fn a_report_carries_the_times_of_the_stages_before_it() {
        let folder = tempfile::tempdir().unwrap();
        let [scan, report] = ["grid.xyz", "report.json"].map(|name| folder.path().join(name));
        let rows: Vec<String> = (0..100)
            .map(|k| format!("{} {} {}", k % 10, k / 10, (k % 10) * (k / 10)))
            .collect();
        std::fs::write(&scan, rows.join("\n")).unwrap();
        let options = Options {
            input: InputOptions {
                grid: Some([10, 10]),
                ..InputOptions::default()
            },
            output: OutputOptions {
                reports: vec![report.clone()],
                ..OutputOptions::default()
            },
            ..Options::default()
        };
        fit_from(&Source::file(&scan), &[], &options, &Silent).unwrap();
        let text = std::fs::read_to_string(report).unwrap();
        let written: serde_json::Value = serde_json::from_str(&text).unwrap();
        for stage in ["read", "fit", "deviation", "total"] {
            assert!(written["time"][stage].as_f64().unwrap() > 0.0, "{stage}");
        }
    }
}
