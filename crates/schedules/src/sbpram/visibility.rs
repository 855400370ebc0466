//! Phase 2', what is its own in it: a V'-task finds form factor and visibility of one new link.

use crate::pairs::Pairs;
use crate::store;
use crate::worker::Worker;
use isolux_machine::Processor;

impl<P: Processor, K: Pairs> Worker<'_, P, K> {
    /// V': form factors and visibilities of links that have neither.
    pub(crate) async fn complete_links(&self, element: u32, links: &[u32]) {
        for &link in links {
            let [source, path, _, visibility]: [u64; 4] = self.p.load_block(self.cx.store.link(link, 0)).await;
            debug_assert_eq!(visibility, store::UNKNOWN);
            let receiver = self.place_of(element).await;
            let place = self.place(store::Store::path(path));
            let form_factor = self.form_factor(receiver, place).await;
            let word = if form_factor > 0.0 {
                store::encode(self.sight([(element, receiver), (source as u32, place)]).await)
            } else {
                store::DEAD
            };
            self.p.store_block(self.cx.store.link(link, store::FORM_FACTOR), [form_factor.to_bits(), word]).await;
        }
    }
}
