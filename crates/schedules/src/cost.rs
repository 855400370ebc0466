//! Classes of work: what kernels count goes in, what a machine is charged comes out. What one of a class costs is the
//! machine's affair; the figures of the simulated ones are in `cost_model.toml`.

use isolux_core::kernels::Counts;
use isolux_machine::{Work, WorkClass};

/// The names of all classes, in the order of their numbers.
pub const CLASSES: [&str; 16] = [
    "form_factor",
    "visibility",
    "ray",
    "node_visit",
    "fragment_test",
    "oracle",
    "gather",
    "order",
    "insert",
    "cut",
    "split",
    "settle",
    "pull",
    "queue",
    "cull",
    "interpolate",
];

/// Instructions for one of each class, as a table `[work]`.
pub const COST_MODEL: &str = include_str!("cost_model.toml");

/// A decision about one link.
pub(crate) const ORACLE: WorkClass = WorkClass(5);
/// One link's term of a sum of light.
pub(crate) const GATHER: WorkClass = WorkClass(6);
/// A link that finds its place in the order of a list: of n links, each counts [`sorting_depth`] times.
pub(crate) const ORDER: WorkClass = WorkClass(7);
/// A polygon that is to be inserted in the tree.
pub(crate) const INSERT: WorkClass = WorkClass(8);
/// A piece was compared with a plane.
pub(crate) const CUT: WorkClass = WorkClass(9);
/// A piece was cut in two.
pub(crate) const SPLIT: WorkClass = WorkClass(10);
/// A leaf got its radiosity.
pub(crate) const SETTLE: WorkClass = WorkClass(11);
/// A parent got the means of its children.
pub(crate) const PULL: WorkClass = WorkClass(12);
/// Half of a task's way through a queue: it was put in, or taken out. What lies between the loads and stores of that.
pub(crate) const QUEUE: WorkClass = WorkClass(13);
/// Two polygons were asked whether they face each other.
pub(crate) const CULL: WorkClass = WorkClass(14);
/// A step on the way to a value at a corner: [`corner_steps`].
pub(crate) const INTERPOLATE: WorkClass = WorkClass(15);

/// Comparisons of one link among `n`, as the class `order` counts them: `max(1, ceil(log2 n) - 1)`. For all n that is
/// about what no sort can do without (`log2 n!`, which is `n log2 n - 1.44 n`).
#[must_use]
pub fn sorting_depth(n: u64) -> u64 {
    u64::from(n.max(1).next_power_of_two().trailing_zeros()).saturating_sub(1).max(1)
}

/// Steps to the value at a corner of a leaf, as the class `interpolate` counts them: one for each level that is
/// descended from the root to a leaf at the corner, two for each point beside the corner for which that is done, ten for
/// the corner itself. In the room the three cost 116, 248 and 1,165 instructions where each is fitted by itself.
#[must_use]
pub fn corner_steps(points: u64, levels: u64) -> u64 {
    10 + 2 * points + levels
}

/// What a kernel counted, by class.
pub(crate) fn of_kernel(counts: &Counts) -> Work {
    let mut work = Work::default();
    add_kernel(&mut work, counts);
    work
}

/// Adds what a kernel counted.
pub(crate) fn add_kernel(work: &mut Work, counts: &Counts) {
    let by_class = [counts.form_factors, counts.visibilities, counts.rays, counts.node_visits, counts.fragment_tests];
    for (class, count) in by_class.into_iter().enumerate() {
        work.add_of(WorkClass(class), count);
    }
}
