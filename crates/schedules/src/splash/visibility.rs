//! Phase 2, what is SPLASH-2's own in it: a V-task finds up to four visibilities. What chains of such tasks bound is D33.

use crate::pairs::Pairs;
use crate::store;
use crate::worker::Worker;
use isolux_machine::Processor;

impl<P: Processor, K: Pairs> Worker<'_, P, K> {
    /// V: visibilities of links whose form factors are known.
    pub(crate) async fn visibilities(&self, element: u32, links: &[u32]) {
        for &link in links {
            let [source, path]: [u64; 2] = self.p.load_block(self.cx.store.link(link, 0)).await;
            let receiver = self.place_of(element).await;
            let sight = self.sight([(element, receiver), (source as u32, self.place(store::Store::path(path)))]).await;
            self.p.store(self.cx.store.link(link, store::VISIBILITY), store::encode(sight)).await;
        }
    }
}
