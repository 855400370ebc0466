//! Counting what a kernel computed and touched: simulated machines turn the counts into time, reports print them, and
//! real runs pay nothing for [`NoProbe`].

use serde::{Deserialize, Serialize};

/// Told by kernels what they do. Every method defaults to nothing, so that an unused count compiles away.
pub trait Probe {
    /// A form factor between two patches was evaluated with this many point-to-patch (or point-to-disk) terms.
    fn form_factor(&mut self, _terms: u32) {}
    /// A visibility between two patches is being evaluated.
    fn visibility(&mut self) {}
    /// A ray starts.
    fn ray(&mut self) {}
    /// A tree node was visited by a ray; `node` names it.
    fn node_visit(&mut self, _node: u32) {}
    /// A fragment was tested against a ray; `fragment` names it.
    fn fragment_test(&mut self, _fragment: u32) {}
    /// A piece of a polygon came by a tree node and was classified against its plane; `node` names it.
    fn cut(&mut self, _node: u32) {}
    /// It was on both sides, and was cut in two.
    fn split(&mut self) {}
    /// The oracle decided on a link.
    fn oracle(&mut self) {}
    /// One link was gathered.
    fn gather(&mut self) {}
}

/// Counts nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoProbe;

impl Probe for NoProbe {}

/// Counts everything.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// Form factors evaluated.
    pub form_factors: u64,
    /// Point-to-patch or point-to-disk terms in them.
    pub form_factor_terms: u64,
    /// Visibilities evaluated.
    pub visibilities: u64,
    /// Rays shot.
    pub rays: u64,
    /// Tree nodes visited.
    pub node_visits: u64,
    /// Ray-fragment tests.
    pub fragment_tests: u64,
    /// Oracle decisions.
    pub oracle_decisions: u64,
    /// Links gathered.
    pub gathers: u64,
    /// Pieces of polygons classified against a tree node's plane.
    #[serde(default)]
    pub cuts: u64,
    /// Pieces cut in two.
    #[serde(default)]
    pub splits: u64,
}

impl Counts {
    /// Adds what another kernel run counted.
    pub fn add(&mut self, other: &Counts) {
        self.form_factors += other.form_factors;
        self.form_factor_terms += other.form_factor_terms;
        self.visibilities += other.visibilities;
        self.rays += other.rays;
        self.node_visits += other.node_visits;
        self.fragment_tests += other.fragment_tests;
        self.oracle_decisions += other.oracle_decisions;
        self.gathers += other.gathers;
        self.cuts += other.cuts;
        self.splits += other.splits;
    }
}

impl Probe for Counts {
    fn form_factor(&mut self, terms: u32) {
        self.form_factors += 1;
        self.form_factor_terms += u64::from(terms);
    }
    fn visibility(&mut self) {
        self.visibilities += 1;
    }
    fn ray(&mut self) {
        self.rays += 1;
    }
    fn node_visit(&mut self, _node: u32) {
        self.node_visits += 1;
    }
    fn fragment_test(&mut self, _fragment: u32) {
        self.fragment_tests += 1;
    }
    fn cut(&mut self, _node: u32) {
        self.cuts += 1;
    }
    fn split(&mut self) {
        self.splits += 1;
    }
    fn oracle(&mut self) {
        self.oracle_decisions += 1;
    }
    fn gather(&mut self) {
        self.gathers += 1;
    }
}
