//! Phase 3: tasks go down the quadtrees; leaves interpolate.

use crate::pairs::Pairs;
use crate::store;
use crate::task::Task;
use crate::worker::Worker;
use isolux_machine::Processor;

impl<P: Processor, K: Pairs> Worker<'_, P, K> {
    /// A: makes tasks for the children of an element, or finds a leaf's vertex values.
    pub(crate) async fn interpolate_below(&self, element: u32) {
        let first = self.p.load(self.cx.store.element(element, store::FIRST_CHILD)).await as u32;
        if first == 0 {
            self.interpolate_leaf(element).await;
            return;
        }
        self.cx.queues.announce(&self.p, 4).await;
        for k in 0..4 {
            self.put(Task::Interpolate { element: first + k }).await;
        }
    }
}
