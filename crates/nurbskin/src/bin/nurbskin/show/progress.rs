//! Progress on a terminal, and Ctrl-C.

use super::Show;
use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};
use nurbskin::progress::Progress;
use std::fmt::Write;
use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Set by Ctrl-C.
static CANCELLED: AtomicBool = AtomicBool::new(false);
/// Set before files are written.
static WRITING: AtomicBool = AtomicBool::new(false);
/// Time for a computation to stop by itself.
const PATIENCE: Duration = Duration::from_millis(700);
/// What is done sooner shows no progress.
const SOON: Duration = Duration::from_secs(1);

/// Asks the running computation to stop, and stops the process if it does not do so soon. Files that are being written
/// are finished or removed first: whoever starts writing after this sees that it is cancelled.
#[expect(clippy::exit, reason = "the main thread does not listen")]
pub(crate) fn cancel(show: Show) {
    CANCELLED.store(true, Ordering::SeqCst);
    std::thread::sleep(PATIENCE);
    if !WRITING.load(Ordering::SeqCst) {
        let failure = nurbskin::Error::Cancelled.into();
        // Nobody is left to be told that this cannot be told.
        let _ = show.failed(&failure);
        std::process::exit(i32::from(crate::ERROR));
    }
}

/// A line of progress on stderr, on a terminal, for what takes longer than a second. Lengths of stages are shown with
/// a fraction and an estimate where they are known; others say how far they have come, or the number of rounds.
#[derive(Debug)]
pub(crate) struct Terminal {
    bar: Option<ProgressBar>,
    start: Instant,
    show: Show,
    /// Warnings that were told while the computation ran.
    told: Mutex<Vec<String>>,
    stage: Mutex<Stage>,
}

/// The stage that runs.
#[derive(Debug, Default)]
struct Stage {
    name: &'static str,
    has_length: bool,
    rounds: u64,
    /// Whether it says how far it has come.
    tells: bool,
}

impl Terminal {
    pub(crate) fn new(show: Show) -> Self {
        let shown = !show.quiet && std::io::stderr().is_terminal();
        let bar = shown.then(|| {
            let bar = ProgressBar::no_length();
            bar.set_draw_target(indicatif::ProgressDrawTarget::hidden());
            bar
        });
        Self {
            bar,
            start: Instant::now(),
            show,
            told: Mutex::default(),
            stage: Mutex::default(),
        }
    }

    /// Shows the bar once a second has passed.
    fn wake(&self) {
        let Some(bar) = &self.bar else { return };
        if bar.is_hidden() && self.start.elapsed() > SOON {
            bar.set_draw_target(indicatif::ProgressDrawTarget::stderr());
            bar.enable_steady_tick(Duration::from_millis(100));
        }
    }

    /// Removes the bar; what was told already, to be told only once.
    pub(crate) fn finish(&self) -> Vec<String> {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
        let told = self.told.lock();
        told.map_or_else(|_| Vec::new(), |mut told| std::mem::take(&mut *told))
    }
}

/// How long the stage will still take, once a part of it is done.
fn left(state: &ProgressState, out: &mut dyn Write) {
    let left = state.eta();
    if state.pos() > 0 && !left.is_zero() {
        // A line of progress that cannot be written is missing, and no more.
        let _ = write!(out, ", about {} left", HumanDuration(left));
    }
}

/// A stage of the library in words.
fn words(stage: &'static str) -> &'static str {
    match stage {
        "read" => "reading",
        "clean" => "cleaning the scan",
        "order" => "finding the shape",
        "rarefy" => "choosing lines of points",
        "enrich" => "densifying",
        "fit" | "approximate" => "fitting",
        "align" => "aligning",
        "deviation" => "measuring the deviation",
        "check" => "checking",
        "page" => "making the page",
        "write" => "writing",
        other => other,
    }
}

impl Progress for Terminal {
    fn stage(&self, name: &'static str, steps: Option<u64>) {
        WRITING.store(name == "write", Ordering::SeqCst);
        if let Ok(mut stage) = self.stage.lock() {
            *stage = Stage {
                name,
                has_length: steps.is_some(),
                ..Stage::default()
            };
        }
        let Some(bar) = &self.bar else { return };
        let template = if steps.is_some() {
            "{msg:26} {bar:24} {percent:>3} %  {elapsed}{left}"
        } else {
            "{msg:26} {spinner} {elapsed}"
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.with_key("left", left));
        }
        match steps {
            Some(steps) => bar.set_length(steps),
            None => bar.unset_length(),
        }
        bar.set_position(0);
        bar.set_message(words(name));
        bar.reset_eta();
        self.wake();
    }

    fn advance(&self, steps: u64) {
        let Some(bar) = &self.bar else { return };
        bar.inc(steps);
        if let Ok(mut stage) = self.stage.lock() {
            stage.rounds += steps;
            if !stage.has_length && !stage.tells {
                bar.set_message(format!("{}, round {}", words(stage.name), stage.rounds));
            }
        }
        self.wake();
    }

    fn tell(&self, so_far: &str) {
        let Some(bar) = &self.bar else { return };
        if let Ok(mut stage) = self.stage.lock() {
            stage.tells = true;
            bar.set_message(format!("{}: {so_far}", words(stage.name)));
        }
        self.wake();
    }

    fn warn(&self, message: &str) {
        let tell = || self.show.warning(message);
        match &self.bar {
            Some(bar) => bar.suspend(tell),
            None => tell(),
        }
        if let Ok(mut told) = self.told.lock() {
            told.push(message.to_owned());
        }
    }

    fn cancelled(&self) -> bool {
        CANCELLED.load(Ordering::SeqCst)
    }
}
