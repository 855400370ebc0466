//! What each switch of [`Ideas`] says it leaves out is left out, and the light is still that of the scene.

#![allow(clippy::unwrap_used, reason = "a test")]

use isolux_core::scene::{BuildOptions, Scene};
use isolux_core::tree::ElementId;
use isolux_formats::read::read;
use isolux_wavefront::{Control, Ideas, Outcome, Prepared, Request, Stage};
use std::sync::{Arc, LazyLock};

/// A solve of the furnished room.
struct Solve {
    outcome: Outcome,
    stages: Vec<Stage>,
}

static ROOM: LazyLock<Arc<Scene>> = LazyLock::new(|| {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/room.glb");
    Arc::new(Scene::build(read(path.as_ref(), &Default::default()).unwrap(), &BuildOptions::default()).unwrap())
});

static PREPARED: LazyLock<Prepared> = LazyLock::new(|| Prepared::new(ROOM.clone()));

/// With all ideas.
static WHOLE: LazyLock<Solve> = LazyLock::new(|| solved(Ideas::default()));

/// By the idea that is left out.
static WITHOUT: LazyLock<Vec<(&str, Solve)>> =
    LazyLock::new(|| Ideas::each_left_out().into_iter().map(|(name, ideas)| (name, solved(ideas))).collect());

fn without(name: &str) -> &'static Solve {
    WITHOUT.iter().find_map(|(idea, solve)| (*idea == name).then_some(solve)).unwrap()
}

/// For an error of 20 %: the first at which pairs of elements are refined by all their causes.
fn solved(ideas: Ideas) -> Solve {
    let request = Request { ideas, ..Request::new(0.2) };
    let solved = PREPARED.solve(&request, &Control::default());
    Solve { outcome: solved.outcome(&ROOM), stages: solved.stages }
}

impl Solve {
    /// Mean irradiance over the fronts, and bands.
    fn mean(&self) -> f64 {
        let irradiance = |front: usize| self.outcome.light.irradiance(ElementId(front as u32)).mean();
        (0..ROOM.fronts).map(|front| ROOM.polygons[front].area * irradiance(front)).sum::<f64>() / ROOM.area()
    }

    /// Links with a cluster at one end at least.
    fn of_clusters(&self) -> usize {
        let links = &self.outcome.links;
        let elements = self.outcome.fields.len() as u32;
        links.receiver.iter().zip(&links.source).filter(|&(&a, &b)| a.max(b) >= elements).count()
    }

    /// Links that are proven to be clear.
    fn proven(&self) -> usize {
        self.outcome.links.proven.iter().filter(|&&proven| proven == 1).count()
    }

    /// Leaves whose fields are not the same all over, but for some roundings.
    fn varying(&self) -> usize {
        let elements = &self.outcome.elements;
        let leaves = (0..self.outcome.fields.len()).filter(|&index| elements.is_leaf(ElementId(index as u32)));
        leaves
            .filter(|&leaf| {
                let field = self.outcome.fields[leaf].as_flattened();
                (0..3).any(|band| {
                    let first = field[band];
                    (band..field.len())
                        .step_by(3)
                        .any(|at| (field[at] - first).abs() > 8.0 * f32::EPSILON * first.abs())
                })
            })
            .count()
    }

    /// Elements that are covered in part.
    fn covered_in_part(&self) -> usize {
        self.outcome.light.open_shares().iter().filter(|&&share| share > 0.0 && share < 1.0).count()
    }

    /// Gathers at the leaves.
    fn gathers_at_leaves(&self) -> usize {
        self.stages.iter().map(|stage| stage.passes[1] as usize).sum()
    }

    /// Packets of rays to single points.
    fn packets(&self) -> usize {
        self.stages.last().unwrap().evaluated[1] as usize
    }

    /// Links whose rays are all blocked.
    fn dark_links(&self) -> usize {
        self.stages.last().unwrap().dark_links
    }
}

/// With all ideas there is some of what one of them brings, without it none.
fn is_left_out(name: &str, what: fn(&Solve) -> usize) {
    assert!(what(&WHOLE) > 0);
    assert_eq!(what(without(name)), 0);
}

/// Catches pairs that clusters still stand for though they are off.
#[test]
fn without_clusters_only_elements_are_linked() {
    is_left_out("clusters", Solve::of_clusters);
}

/// Catches a way by which a slope still gets into a leaf: of links, of leaves anew, of visibilities.
#[test]
fn without_linear_receivers_leaves_are_even() {
    is_left_out("linear_receivers", Solve::varying);
}

/// Catches gathers at leaves that are made though nothing is wanted of them.
#[test]
fn without_leaves_anew_links_alone_are_gathered() {
    is_left_out("leaves_anew", Solve::gathers_at_leaves);
}

/// Catches a verdict that asks for rays all the same.
#[test]
fn without_more_rays_links_have_sixteen() {
    is_left_out("more_rays", Solve::packets);
}

/// Catches links that are taken to be clear without a proof.
#[test]
fn without_proofs_no_link_is_clear() {
    is_left_out("clear_proofs", Solve::proven);
}

/// Catches links that are kept aside though sixteen blocked rays are taken for a proof.
#[test]
fn without_dark_links_what_is_blocked_is_dropped() {
    is_left_out("dark_links", Solve::dark_links);
}

/// Catches elements that are crossed by lines that are not to be known.
#[test]
fn without_contact_lines_polygons_are_covered_as_a_whole() {
    is_left_out("contact_lines", Solve::covered_in_part);
}

/// Catches links that are dropped by a proof that is not to be made.
#[test]
fn without_proofs_of_blocking_more_links_stay_dark() {
    let (more, less) = (without("blocked_proofs").dark_links(), WHOLE.dark_links());
    assert!(more > less, "{more} {less}");
}

/// Catches a switch that is connected to nothing, and one that breaks the light. Of all these solves for 20 % none has a mean
/// that is off by more than 3.5 %: that without leaves anew.
#[test]
fn all_change_the_links_and_keep_the_light() {
    for (name, solve) in WITHOUT.iter() {
        let dark = (solve.dark_links(), WHOLE.dark_links());
        assert!(solve.outcome.links != WHOLE.outcome.links || dark.0 != dark.1, "{name}");
        let apart = solve.mean() / WHOLE.mean() - 1.0;
        assert!(apart.abs() < 0.05, "{name}: {apart}");
    }
}
