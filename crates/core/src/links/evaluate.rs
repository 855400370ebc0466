//! The canonical evaluation of a pair: two elements go in, their form factor and visibility come out, the same
//! numbers whichever of the two asks.

use crate::kernels::form_factor::{FormFactor, exchange_area};
use crate::kernels::visibility::{Blocker, Covered, Sampling, Sight, open_share, sight, sight_ray_by_ray};
use crate::kernels::{Patch, Probe};
use crate::sampling::mix;
use crate::scene::Scene;
use crate::tree::{Bsp, ElementId, Elements, Path};

/// A patch and its name: what the evaluation of a pair depends on.
#[derive(Clone, Copy, Debug)]
pub struct Named<'a> {
    /// The name.
    pub path: Path,
    /// The patch.
    pub patch: Patch<'a>,
}

/// Evaluates pairs of elements of one scene.
#[derive(Clone, Copy, Debug)]
pub struct Evaluator<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its surfaces, for rays.
    pub bsp: &'a Bsp,
    /// Form factor kernel.
    pub form_factor: FormFactor,
    /// Rays of a visibility.
    pub sampling: Sampling,
    /// What becomes of covered parts.
    pub covered: Covered,
    /// Seed of the sample points.
    pub seed: u64,
}

impl Evaluator<'_> {
    /// Exchange area `A_a F_ab = A_b F_ba` of two elements, m², unoccluded.
    #[must_use]
    pub fn exchange_area<P: Probe>(&self, elements: &Elements, a: ElementId, b: ElementId, probe: &mut P) -> f64 {
        self.exchange_area_of(named(elements, a), named(elements, b), probe)
    }

    /// [`Evaluator::exchange_area`] of patches that are in no [`Elements`].
    #[must_use]
    pub fn exchange_area_of<P: Probe>(&self, a: Named<'_>, b: Named<'_>, probe: &mut P) -> f64 {
        let (a, b) = canonical(a, b);
        exchange_area(&a.patch, &b.patch, self.form_factor, probe)
    }

    /// Form factor from receiver to source, in `[0, 1]`, unoccluded.
    #[must_use]
    pub fn form_factor<P: Probe>(
        &self,
        elements: &Elements,
        receiver: ElementId,
        source: ElementId,
        probe: &mut P,
    ) -> f64 {
        (self.exchange_area(elements, receiver, source, probe) / elements.get(receiver).area).min(1.0)
    }

    /// Share of an element that nothing covers, in `[0, 1]`.
    #[must_use]
    pub fn open_share<P: Probe>(&self, elements: &Elements, id: ElementId, probe: &mut P) -> f64 {
        match self.covered {
            Covered::Counted => 1.0,
            Covered::LeftOut => {
                let seed = mix(mix(self.seed ^ elements.get(id).path.to_bits()));
                open_share(self.bsp, self.scene, &elements.patch(id), seed, probe)
            }
        }
    }

    /// Visibility of the pair, and how it is known.
    #[must_use]
    pub fn sight<P: Probe>(&self, elements: &Elements, a: ElementId, b: ElementId, probe: &mut P) -> Sight {
        self.sight_of(named(elements, a), named(elements, b), probe)
    }

    /// [`Evaluator::sight`] of patches that are in no [`Elements`].
    #[must_use]
    pub fn sight_of<P: Probe>(&self, a: Named<'_>, b: Named<'_>, probe: &mut P) -> Sight {
        let (a, b) = canonical(a, b);
        let seed = self.seed_of(a, b);
        sight(self.bsp, self.scene, &a.patch, &b.patch, self.sampling, seed, &mut Blocker::default(), probe)
    }

    /// As [`Evaluator::sight`], bit for bit; `probe` is told the walks of single rays.
    #[must_use]
    pub fn sight_ray_by_ray<P: Probe>(&self, elements: &Elements, a: ElementId, b: ElementId, probe: &mut P) -> Sight {
        self.sight_ray_by_ray_of(named(elements, a), named(elements, b), probe)
    }

    /// [`Evaluator::sight_ray_by_ray`] of patches that are in no [`Elements`].
    #[must_use]
    pub fn sight_ray_by_ray_of<P: Probe>(&self, a: Named<'_>, b: Named<'_>, probe: &mut P) -> Sight {
        let (a, b) = canonical(a, b);
        let seed = self.seed_of(a, b);
        sight_ray_by_ray(self.bsp, self.scene, &a.patch, &b.patch, self.sampling, seed, probe)
    }

    fn seed_of(&self, a: Named<'_>, b: Named<'_>) -> u64 {
        [a, b].into_iter().fold(self.seed, |seed, one| mix(seed ^ one.path.to_bits()))
    }
}

fn named(elements: &Elements, id: ElementId) -> Named<'_> {
    Named { path: elements.get(id).path, patch: elements.patch(id) }
}

/// The pair in the order of paths.
fn canonical<'a>(a: Named<'a>, b: Named<'a>) -> (Named<'a>, Named<'a>) {
    if a.path <= b.path { (a, b) } else { (b, a) }
}
