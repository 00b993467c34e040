//! The network of a part, as the choice asks for it.

use super::{AUTOMATIC_BUDGET, is_better, is_sound, will_do};
use crate::surfacing::SurfacingOptions;
use crate::surfacing::network::Search;
use crate::surfacing::part::{Made, Task};
use nurbskin_geometry::{Error, Result};

/// The network of a part, made where it is first asked for.
pub(super) struct Network<'t, 'a> {
    task: &'t Task<'a>,
    pub(super) search: Search,
    /// Whether it is given up for the time being where the last fit is far from sound, since one surface is there in its place.
    pub(super) at_once: bool,
    pub(super) made: Option<Result<Made>>,
}

impl<'t, 'a> Network<'t, 'a> {
    pub(super) fn of(task: &'t Task<'a>) -> Self {
        Self {
            task,
            search: Search::default(),
            at_once: false,
            made: None,
        }
    }

    /// The network, if there is one that meets the tolerance and does not intersect itself.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub(super) fn sound(&mut self) -> Result<Option<&Made>> {
        let task = Task {
            only_met: self.at_once,
            ..*self.task
        };
        let made = self.made.get_or_insert_with(|| self.search.fit(&task));
        match made {
            Err(Error::Cancelled) => Err(Error::Cancelled),
            made => Ok(made.as_ref().ok().filter(|made| is_sound(made))),
        }
    }

    /// Whether it was made, and is not sound.
    pub(super) fn is_unsound(&self) -> bool {
        let made = self.made.as_ref();
        made.is_some_and(|made| !made.as_ref().is_ok_and(is_sound))
    }

    /// The control points of the network, if it was made and reaches what was asked, but lacks faces.
    pub(super) fn opened(&self) -> Option<usize> {
        let made = self.made.as_ref()?.as_ref().ok()?;
        (will_do(made) && made.is_opened).then(|| made.part.shape.control_points())
    }

    /// The network that lacks faces, or one that does not after further fits. It stays known if neither will do.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub(super) fn closed(&mut self) -> Result<Option<Made>> {
        match self.take() {
            Ok(made) if will_do(&made) => Ok(Some(made)),
            Err(Error::Cancelled) => Err(Error::Cancelled),
            made => {
                self.made = Some(made);
                Ok(None)
            }
        }
    }

    /// Whether it was made, is sound, and is better than a single surface.
    pub(super) fn beats(&self, single: &Made) -> bool {
        let made = self.made.as_ref().and_then(|made| made.as_ref().ok());
        made.is_some_and(|made| is_sound(made) && is_better(made, single, self.task))
    }

    /// The control points that one surface may take for a requested tolerance to be as good as the network, if that was
    /// made: as many, or the usual budget.
    pub(super) fn matched(&self) -> Option<usize> {
        self.task.tolerance.asked()?;
        let made = self.made.as_ref()?.as_ref().ok()?;
        Some(made.part.shape.control_points().max(AUTOMATIC_BUDGET))
    }

    /// The network, with notes on the options that have no effect on it. One that was given up is gone on with.
    pub(super) fn take(&mut self) -> Result<Made> {
        let given_up = std::mem::take(&mut self.at_once) && self.is_unsound();
        let made = self.made.take().filter(|_| !given_up);
        let made = made.unwrap_or_else(|| self.search.fit(self.task));
        made.map(|made| noted(made, self.task.options))
    }
}

/// Adds notes on the options that have no effect on a network.
fn noted(mut made: Made, options: &SurfacingOptions) -> Made {
    if options.topology.is_some() {
        made.notes
            .warn("the topology has no effect: a network has that of the scan");
    }
    if options.degree != SurfacingOptions::default().degree {
        let p = nurbskin_network::fit::DEGREE;
        made.notes.warn(format!(
            "the degree has no effect: a network has degree {p}"
        ));
    }
    made
}
