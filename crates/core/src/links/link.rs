//! One link, as stored with its receiver.

use crate::kernels::visibility::Sight;
use crate::tree::ElementId;

/// Light that a receiver gathers from one source: `F V B_source`. The receiver is the list that holds the link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// Where the light comes from.
    pub source: ElementId,
    /// Share of unblocked light; the sign bit says that it is sampled (-0.0 and -1.0 included); NaN before it has been
    /// evaluated.
    visibility: f32,
    /// Share of what leaves the receiver that reaches the source, unoccluded, in `(0, 1]`.
    pub form_factor: f64,
}

impl Link {
    /// A link whose visibility has not been evaluated yet.
    #[must_use]
    pub fn open(source: ElementId, form_factor: f64) -> Link {
        Link { source, visibility: f32::NAN, form_factor }
    }

    /// A link with everything evaluated.
    #[must_use]
    pub fn new(source: ElementId, form_factor: f64, sight: Sight) -> Link {
        let mut link = Link::open(source, form_factor);
        link.set_sight(sight);
        link
    }

    /// Share of light that passes, in `[0, 1]`; `None` before it has been evaluated.
    #[must_use]
    pub fn visibility(&self) -> Option<f64> {
        self.sight().map(|sight| sight.share)
    }

    /// Visibility and how it is known; `None` before it has been evaluated.
    #[must_use]
    pub fn sight(&self) -> Option<Sight> {
        let share = f64::from(self.visibility.abs());
        (!share.is_nan()).then(|| Sight { share, proven: self.visibility.is_sign_positive() })
    }

    /// Stores an evaluated visibility.
    pub fn set_sight(&mut self, sight: Sight) {
        self.visibility = (sight.share as f32).copysign(if sight.proven { 1.0 } else { -1.0 });
    }

    /// `F V`: what the gather multiplies the source's radiosity by; 0 before the visibility has been evaluated.
    #[must_use]
    pub fn weight(&self) -> f64 {
        self.visibility().map_or(0.0, |visibility| self.form_factor * visibility)
    }
}
