//! The present size of departures from the paper, by their numbers in `DEVIATIONS.md`: those that need no file and no
//! facade. The others are in `crates/isolux/tests/deviations.rs`, and in the tests that `DEVIATIONS.md` names.

#![allow(clippy::unwrap_used, reason = "tests")]

mod inputs;
mod settle;

use inputs::{Make, built, empty, grey, v};
use isolux_core::DVec3;
use isolux_core::kernels::form_factor::{FormFactor, exchange_area};
use isolux_core::kernels::visibility::{Covered, Rays, Sampling, Weighting, visibility, visibility_ray_by_ray};
use isolux_core::kernels::{Counts, NoProbe, Patch};
use isolux_core::links::Hierarchy;
use isolux_core::scene::{Polygon, Scene};
use isolux_core::solution::{Flow, Parameters, Solver, Stop, Unobserved, Update, balance};
use isolux_core::tree::{Bsp, ElementId, InsertionOrder};
use isolux_core::units::Rgb;
use settle::{parameters, settled};

fn tree(scene: &Scene) -> Bsp {
    Bsp::build(scene, InsertionOrder::AsGiven)
}

fn patch(polygon: &Polygon) -> Patch<'_> {
    Patch { corners: &polygon.corners, plane: &polygon.plane, area: polygon.area }
}

/// D22: what a block covers of the floor is dark, and the paper's mean over the element takes that from the open part:
/// of the light of a closed box, 1.5 % end where nobody sees them, and 0.005 % where covered parts are left out. Would catch
/// open shares that are not measured or not used, and a balance that books the loss elsewhere.
#[test]
fn d22_covered_parts_swallow_light_unless_they_are_left_out() {
    let mut input = empty();
    let walls = input.object("walls");
    let paint = input.material("paint", grey(0.7, 0.0));
    let lamp = input.material("lamp", grey(0.7, 5.0));
    input.inside_of_box(walls, paint, v(0.0, 0.0, 0.0), v(3.0, 2.0, 2.5));
    input.faces[3].material = lamp;
    let block = input.object("block");
    input.outside_of_box(block, paint, v(1.1, 0.0, 1.1), v(2.1, 0.8, 1.9));
    let scene = built(input);
    let bsp = tree(&scene);
    let lost = [Covered::Counted, Covered::LeftOut].map(|covered| {
        let solver = settled(&scene, &bsp, Parameters { covered, ..parameters(0.05, 0.01) }, 1000);
        let active = solver.active().to_vec();
        let balance =
            balance(&scene, &bsp, solver.hierarchy(), &active, 0, &mut Counts::default(), &mut Unobserved).unwrap();
        // Of the same light: both balances close.
        // Measured +0.009 and +0.015.
        assert!(balance.imbalance().abs() < 0.02, "{covered:?}: {balance:?}");
        balance.lost_to_backs.mean() / balance.emitted.mean()
    });
    assert!((0.014..0.016).contains(&lost[0]) && lost[1] < 2e-4, "{lost:?}");
}

/// D4: a back that sees a share s of lit surroundings is overlooked in `(1 - s)^64` of all seeds (here 0.95 % and 54 %),
/// and its light is then reported as lost. Would catch another number of rays, rays that are not drawn by the cosine, a
/// back that wakes without light, and a balance that hides what sleeping backs swallow.
#[test]
fn d04_backs_that_see_little_light_are_overlooked_as_often_as_stated() {
    let mut input = empty();
    let thing = input.object("thing");
    let paint = input.material("two-sided", grey(0.5, 0.0));
    input.materials[paint as usize].two_sided = true;
    let glow = input.material("glow", grey(0.0, 1.0));
    input.face(thing, paint, &[v(0.0, 0.0, 0.0), v(0.0, 0.0, 1.0), v(1.0, 0.0, 1.0), v(1.0, 0.0, 0.0)]);
    // Below it, face up: only the panel's back sees it.
    let (low, high, y) = (0.4, 0.6, -1.0);
    input.face(thing, glow, &[v(low, y, low), v(low, y, high), v(high, y, high), v(high, y, low)]);
    let scene = built(input);
    let bsp = tree(&scene);
    let mut overlooked = Vec::new();
    let mut share = 0.0;
    let seeds = 2000;
    for seed in 0..seeds {
        let parameters = Parameters { seed, ..parameters(1.0, 1.0) };
        let mut solver: Solver<'_, Counts> = Solver::new(&scene, &bsp, parameters);
        assert_eq!(solver.link_roots(&mut Unobserved), Flow::Continue);
        solver.iterate(&mut Unobserved).unwrap();
        let back = scene.fronts;
        if solver.active()[back] {
            share = solver.hierarchy().links.of(ElementId(back as u32))[0].form_factor;
        } else {
            overlooked.push(seed);
        }
    }
    let expected = (1.0 - share).powi(64);
    let found = overlooked.len() as f64 / seeds as f64;
    // Four standard deviations of the share of 2,000 seeds.
    let noise = (expected * (1.0 - expected) / seeds as f64).sqrt();
    assert!((found - expected).abs() < 4.0 * noise, "{found} {expected}");
    let lost = |seed| {
        let mut solver: Solver<'_, Counts> = Solver::new(&scene, &bsp, Parameters { seed, ..parameters(1.0, 1.0) });
        assert_eq!(solver.link_roots(&mut Unobserved), Flow::Continue);
        solver.iterate(&mut Unobserved).unwrap();
        let active = solver.active().to_vec();
        let hierarchy = solver.hierarchy();
        balance(&scene, &bsp, hierarchy, &active, 0, &mut Counts::default(), &mut Unobserved).unwrap().lost_to_backs
    };
    let awake = (0..seeds).find(|seed| !overlooked.contains(seed)).unwrap();
    assert_eq!(lost(awake), Rgb::ZERO);
    // Of the lamp's 0.04 lm, what its factor sends up to 1 m²; 65,536 rays of which a quarter meets the back: 7e-5.
    let found = lost(overlooked[0])[0];
    assert!((found - share).abs() < 4.0 * 7e-5, "{found} {share}");
}

/// D10: a ray that starts or ends behind a plane is not counted. Would catch counting it as blocked, which takes a patch
/// half behind the other's plane for half hidden (`SPLASH-2`), as it would take light twice from the clipped factor.
#[test]
fn d10_a_patch_half_behind_a_plane_keeps_its_visibility() {
    let mut input = inputs::plain();
    // A floor, and a wall that goes as far below its plane as above it, beside it.
    input.face(0, 0, &[v(0.0, 0.0, 0.0), v(0.0, 0.0, 1.0), v(1.0, 0.0, 1.0), v(1.0, 0.0, 0.0)]);
    input.face(0, 0, &[v(1.5, -0.5, 0.0), v(1.5, -0.5, 1.0), v(1.5, 0.5, 1.0), v(1.5, 0.5, 0.0)]);
    let scene = built(input);
    let bsp = tree(&scene);
    let (floor, wall) = (patch(&scene.polygons[0]), patch(&scene.polygons[1]));
    for rays in [Rays::Sixteen, Rays::TwoHundredFiftySix] {
        for seed in 0..16 {
            let found = visibility(&bsp, &scene, &floor, &wall, rays, seed, &mut NoProbe);
            let plain = visibility_ray_by_ray(&bsp, &scene, &floor, &wall, rays, seed, &mut NoProbe);
            assert_eq!((found, plain), (1.0, 1.0), "{rays:?} {seed}");
        }
    }
    // What SPLASH-2's rule would say: the share of rays between sub-elements that leave both fronts.
    let middles = |p: &Patch<'_>| -> Vec<DVec3> {
        let (a, u, w) = (p.corners[0], p.corners[1] - p.corners[0], p.corners[3] - p.corners[0]);
        let at = |k: u32| (f64::from(k) + 0.5) / 4.0;
        (0..16).map(|k| a + u * at(k % 4) + w * at(k / 4)).collect()
    };
    let mut open = 0;
    for p in middles(&floor) {
        open +=
            middles(&wall).iter().filter(|&&q| floor.plane.distance(q) > 0.0 && wall.plane.distance(p) > 0.0).count();
    }
    assert_eq!(open, 128);
}

/// D11: a ray counts for what it would carry. Would catch weights that say nothing of the light: behind a screen, a floor
/// and a wall see each other along their common edge only, where most of their form factor comes from.
#[test]
fn d11_rays_count_for_what_they_carry() {
    let mut input = inputs::plain();
    input.face(0, 0, &[v(0.0, 0.0, 0.0), v(0.0, 0.0, 1.0), v(1.0, 0.0, 1.0), v(1.0, 0.0, 0.0)]);
    input.face(0, 0, &[v(0.0, 0.0, 0.0), v(0.0, 1.0, 0.0), v(0.0, 1.0, 1.0), v(0.0, 0.0, 1.0)]);
    // A screen in front of the wall.
    input.face(0, 0, &[v(0.3, 0.0, 0.0), v(0.3, 0.0, 1.0), v(0.3, 2.0, 1.0), v(0.3, 2.0, 0.0)]);
    let scene = built(input);
    let bsp = tree(&scene);
    let (floor, wall) = (patch(&scene.polygons[0]), patch(&scene.polygons[1]));
    let mean = |weighting| {
        let sampling = Sampling { rays: Rays::TwoHundredFiftySix, weighting };
        let of = |seed| visibility(&bsp, &scene, &floor, &wall, sampling, seed, &mut NoProbe);
        (0..200).map(of).sum::<f64>() / 200.0
    };
    // The strip of 0.3 before the screen sees all of the wall, the rest nothing: the ratio of the factors.
    let strip = {
        let mut input = inputs::plain();
        input.face(0, 0, &[v(0.0, 0.0, 0.0), v(0.0, 0.0, 1.0), v(0.3, 0.0, 1.0), v(0.3, 0.0, 0.0)]);
        input.face(0, 0, &[v(0.0, 0.0, 0.0), v(0.0, 1.0, 0.0), v(0.0, 1.0, 1.0), v(0.0, 0.0, 1.0)]);
        built(input)
    };
    let area = |p: &Patch<'_>, q: &Patch<'_>| exchange_area(p, q, FormFactor::Lambert, &mut NoProbe);
    let share = area(&patch(&strip.polygons[0]), &patch(&strip.polygons[1])) / area(&floor, &wall);
    let (equal, carried) = (mean(Weighting::Equal), mean(Weighting::Carried));
    // Measured 0.303 and 0.425 of 0.525: weighted rays are low, too, where most of F runs along a common edge.
    assert!((0.29..0.32).contains(&equal), "{equal} of {share}");
    assert!((0.39..0.54).contains(&carried) && carried < share + 0.02, "{carried} of {share}");
}

/// A closed box of 3 x 2 x 2.5 with a lamp for a ceiling.
fn lamp_box(reflectance: f64, lamp: Rgb) -> Scene {
    let mut input = empty();
    let walls = input.object("walls");
    let paint = input.material("paint", grey(reflectance, 0.0));
    let glow = input.material("lamp", grey(reflectance, 0.0));
    input.materials[glow as usize].surface.emission = lamp;
    input.inside_of_box(walls, paint, v(0.0, 0.0, 0.0), v(3.0, 2.0, 2.5));
    input.faces[3].material = glow;
    built(input)
}

/// D13: the oracle and the convergence test see the mean of three bands. Would catch an oracle that looks at the largest
/// or at one band: grey scenes have three equal bands and a red lamp of mean 1 gets the links of a grey lamp of 1, where
/// the paper's method, run on its red alone, would make those of a lamp of 3.
#[test]
fn d13_refinement_looks_at_the_mean_of_three_bands() {
    let of = |lamp| {
        let scene = lamp_box(0.5, lamp);
        let bsp = tree(&scene);
        let solver = settled(&scene, &bsp, parameters(0.05, 0.001), 1000);
        let Hierarchy { links, light, .. } = solver.hierarchy();
        (links.len(), solver.iterations().len(), light.irradiances().to_vec())
    };
    let grey = of(Rgb::splat(1.0));
    assert!(grey.2.iter().all(|irradiance| irradiance[0] == irradiance[1] && irradiance[1] == irradiance[2]));
    let red = of(Rgb([3.0, 0.0, 0.0]));
    assert_eq!((grey.0, grey.1), (red.0, red.1));
    let worst = grey.2.iter().zip(&red.2).map(|(g, r)| (r[0] / (3.0 * g[0]) - 1.0).abs()).fold(0.0, f64::max);
    // Sums of some hundred terms, rounded.
    assert!(worst < 1e-13, "{worst}");
    let paper = of(Rgb::splat(3.0)).0;
    // Measured 7,068 and 65,988: three times finer, nine times as many.
    let ratio = paper as f64 / grey.0 as f64;
    assert!((8.0..11.0).contains(&ratio), "{} {paper}", grey.0);
}

/// D14: the larger of two elements is split if its own area is above the floor. Would catch figure 2's rule, by which a
/// lamp below the floor keeps one link to a whole wall.
#[test]
fn d14_the_larger_element_is_split_whatever_the_other_is() {
    let mut input = inputs::plain();
    input.face(0, 0, &[v(0.0, 0.0, 0.0), v(0.0, 0.0, 1.0), v(1.0, 0.0, 1.0), v(1.0, 0.0, 0.0)]);
    let (low, high) = (0.46, 0.54);
    input.face(0, 0, &[v(low, 1.0, low), v(high, 1.0, low), v(high, 1.0, high), v(low, 1.0, high)]);
    let scene = built(input);
    let bsp = tree(&scene);
    // The lamp has 0.0064 m², the floor 1 m²; no link is small enough.
    let solver = settled(&scene, &bsp, parameters(1e-9, 0.01), 1000);
    let Hierarchy { elements, links, .. } = solver.hierarchy();
    let (floor, lamp) = (ElementId(0), ElementId(1));
    assert!(elements.is_leaf(lamp));
    // 0.01 is between 4^-3 and 4^-4.
    assert_eq!(elements.leaves().filter(|&leaf| elements.get(leaf).polygon == 0).count(), 256);
    assert_eq!((links.of(floor).len(), links.of(lamp).len(), links.len()), (0, 256, 512));
}

/// D17: means are weighted by area, and irradiance is pushed. Would catch a quarter of the sum, which is wrong where
/// quarters differ, and a push that is not the paper's where they are equal.
#[test]
fn d17_means_by_area_are_quarters_of_sums_for_parallelograms_only() {
    let worst = |scene: &Scene| {
        let bsp = tree(scene);
        let solver = settled(scene, &bsp, parameters(0.05, 0.001), 1000);
        let Hierarchy { elements, light, .. } = solver.hierarchy();
        let mut worst = 0.0_f64;
        for id in (0..elements.len() as u32).map(ElementId).filter(|&id| !elements.is_leaf(id)) {
            let quarter: Rgb = elements.children(id).map(|child| light.radiosity(child)).sum::<Rgb>() * 0.25;
            worst = worst.max((quarter[0] / light.radiosity(id)[0] - 1.0).abs());
        }
        // The paper's recursion: radiosity comes down, E is added at the leaf.
        fn pushed(hierarchy: &Hierarchy, scene: &Scene, id: ElementId, above: f64) -> f64 {
            let Hierarchy { elements, links, light } = hierarchy;
            let polygon = &scene.polygons[elements.get(id).polygon as usize];
            let own: f64 = links.of(id).iter().map(|link| link.weight() * light.radiosity(link.source)[0]).sum();
            let here = polygon.reflectance[0] * own + above;
            if elements.is_leaf(id) {
                return ((polygon.emission[0] + here) / light.radiosity(id)[0] - 1.0).abs();
            }
            elements.children(id).map(|child| pushed(hierarchy, scene, child, here)).fold(0.0, f64::max)
        }
        let roots = (0..elements.roots() as u32).map(ElementId);
        let off = roots.map(|root| pushed(solver.hierarchy(), scene, root, 0.0)).fold(0.0, f64::max);
        // The last iteration changed the total by 1e-12.
        assert!(off < 1e-10, "{off}");
        worst
    };
    let boxes = worst(&lamp_box(0.5, Rgb::splat(1.0)));
    // Sums of four terms, rounded.
    assert!(boxes < 1e-14, "{boxes}");
    // A floor that narrows from 3 m to 1 m: its quarters at the wide end are 5/16 of it, at the narrow end 3/16.
    let mut input = empty();
    let thing = input.object("thing");
    let paint = input.material("paint", grey(0.5, 0.0));
    let glow = input.material("glow", grey(0.5, 1.0));
    input.face(thing, paint, &[v(0.0, 0.0, 0.0), v(1.0, 0.0, 2.0), v(2.0, 0.0, 2.0), v(3.0, 0.0, 0.0)]);
    input.face(thing, glow, &[v(0.0, 0.0, 0.0), v(3.0, 0.0, 0.0), v(3.0, 1.0, 0.0), v(0.0, 1.0, 0.0)]);
    let trapezium = worst(&built(input));
    // Measured 0.127, at the root's children: see above.
    assert!((0.11..0.15).contains(&trapezium), "{trapezium}");
}

/// D18: the iteration ends when what is still to come is small. Would catch stopping by the last change, which leaves a
/// multiple of it in a bright closed room.
#[test]
fn d18_stopping_by_the_last_change_leaves_more_than_it_says() {
    let scene = lamp_box(0.9, Rgb::splat(1.0));
    let bsp = tree(&scene);
    let total = |stop| {
        let parameters = Parameters { stop, update: Update::Jacobi, ..parameters(10.0, 0.1) };
        let solver = settled(&scene, &bsp, parameters, 1000);
        (solver.iterations().last().unwrap().total[0], solver.iterations().len())
    };
    let (end, _) = total(Stop::Change(1e-13));
    for epsilon in [0.01, 0.001] {
        let (paper, fewer) = total(Stop::Change(epsilon));
        let (here, more) = total(Stop::Remainder(epsilon));
        // What is missing, in epsilons. Measured 8.0 and 8.7 after 23 and 44 iterations, 0.97 and 0.95 after 43 and 65.
        let [paper, here] = [paper, here].map(|total| (1.0 - total / end) / epsilon);
        assert!((7.0..9.0).contains(&paper), "{epsilon}: {paper} after {fewer}");
        assert!((0.8..=1.0).contains(&here), "{epsilon}: {here} after {more}");
    }
}
