//! Links between elements: storage, evaluation of a pair, and the refinement that decides which pairs exchange light.

mod check;
mod evaluate;
mod link;
mod refine;
mod store;

pub use check::LinkViolation;
pub use evaluate::{Evaluator, Named};
pub use link::Link;
pub use refine::{Hierarchy, Step, refine};
pub use store::Links;
