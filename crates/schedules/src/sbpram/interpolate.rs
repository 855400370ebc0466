//! Phase 3': one loop over all elements; leaves interpolate.

use crate::pairs::Pairs;
use crate::store::{self, Counter};
use crate::worker::Worker;
use isolux_machine::protocols::parallel_for;
use isolux_machine::{Cause, Mark, Processor};

impl<P: Processor, K: Pairs> Worker<'_, P, K> {
    /// A': vertex values of all leaves.
    pub(crate) async fn interpolation_loop(&self) {
        let before = self.p.enter(Mark::new(Cause::Work, "A"));
        let elements = self.p.load(self.cx.store.counter(Counter::Elements)).await;
        parallel_for(&self.p, &self.cx.loops[0], elements, 1, async |element| {
            let element = element as u32;
            if self.p.load(self.cx.store.element(element, store::FIRST_CHILD)).await == 0 {
                self.interpolate_leaf(element).await;
            }
        })
        .await;
        self.p.enter(before);
    }
}
