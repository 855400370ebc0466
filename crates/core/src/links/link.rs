//! One link, as stored with its receiver.

use crate::tree::ElementId;

/// Light that a receiver gathers from one source: `F V B_source`. The receiver is the list that holds the link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// Where the light comes from.
    pub source: ElementId,
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
    pub fn new(source: ElementId, form_factor: f64, visibility: f64) -> Link {
        Link { source, visibility: visibility as f32, form_factor }
    }

    /// Share of unblocked rays, in `[0, 1]`; `None` before it has been evaluated.
    #[must_use]
    pub fn visibility(&self) -> Option<f64> {
        (!self.visibility.is_nan()).then_some(f64::from(self.visibility))
    }

    /// Stores an evaluated visibility.
    pub fn set_visibility(&mut self, visibility: f64) {
        self.visibility = visibility as f32;
    }

    /// `F V`: what the gather multiplies the source's radiosity by; 0 before the visibility has been evaluated.
    #[must_use]
    pub fn weight(&self) -> f64 {
        self.visibility().map_or(0.0, |visibility| self.form_factor * visibility)
    }
}
