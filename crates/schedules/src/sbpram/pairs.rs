//! Phase 1'': one loop over all pairs of roots, each evaluated once for both directions.

use crate::cost;
use crate::pairs::Pairs;
use crate::worker::Worker;
use isolux_core::tree::Path;
use isolux_machine::protocols::parallel_for;
use isolux_machine::{Cause, Mark, Processor};

/// The pair `(i, j)`, `i < j`, with number `index` among all pairs in the order of j, then i.
pub(crate) fn pair(index: u64) -> (usize, usize) {
    // The largest j with j (j - 1) / 2 <= index; the square root may be off by one either way.
    let mut j = ((1.0 + (1.0 + 8.0 * index as f64).sqrt()) / 2.0) as u64;
    while j * (j - 1) / 2 > index {
        j -= 1;
    }
    while j * (j + 1) / 2 <= index {
        j += 1;
    }
    ((index - j * (j - 1) / 2) as usize, j as usize)
}

impl<P: Processor, K: Pairs> Worker<'_, P, K> {
    /// F': form factors and visibility of every pair of roots.
    pub(crate) async fn pair_loop(&self) {
        let roots = &self.cx.problem.active_roots;
        let pairs = roots.len() as u64 * (roots.len() as u64).saturating_sub(1) / 2;
        let before = self.p.enter(Mark::new(Cause::Work, "F"));
        parallel_for(&self.p, &self.cx.loops[0], pairs, 1, async |index| {
            let (i, j) = pair(index);
            self.link_pair(roots[i], roots[j]).await;
        })
        .await;
        self.p.enter(before);
    }

    async fn link_pair(&self, a: u32, b: u32) {
        self.charge(cost::CULL, 1).await;
        if !self.cx.problem.face_each_other(a, b) {
            return;
        }
        let [p, q] = [a, b].map(|root| self.place(Path::root(root)));
        let exchange = self.exchange_area(p, q).await;
        if exchange > 0.0 {
            let sight = self.sight([(a, p), (b, q)]).await;
            self.link_roots(a, b, (exchange / p.area).min(1.0), Some(sight)).await;
            self.link_roots(b, a, (exchange / q.area).min(1.0), Some(sight)).await;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Catches a pair left out, met twice, or met with itself.
    #[test]
    fn all_pairs_have_a_number() {
        let mut index = 0;
        for j in 1..300 {
            for i in 0..j {
                assert_eq!(pair(index), (i, j));
                index += 1;
            }
        }
        let (i, j) = pair(u64::from(u32::MAX) * 4_000_000);
        assert!(i < j);
    }
}
