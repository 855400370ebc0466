//! What is measured: a scene goes in, samples of each kind of work come out, with the counts that a program would be
//! charged by. Kernels run with the paper's settings, on the pairs of a short solve.

use crate::queue::{List, Queue, Ring, Told};
use isolux_core::kernels::form_factor::FormFactor;
use isolux_core::kernels::oracle::{Thresholds, bf_refinement};
use isolux_core::kernels::visibility::{Covered, Rays, visibility_ray_by_ray};
use isolux_core::kernels::{Counts, NoProbe, Probe};
use isolux_core::links::{Evaluator, Link};
use isolux_core::sampling::{Stream, mix};
use isolux_core::scene::Scene;
use isolux_core::solution::{
    Light, Parameters, Roots, Solver, Stop, Unobserved, Update, area_weights, around_corner, corner_mean, gather_sum,
    mean_of_children, reflected,
};
use isolux_core::tree::{Bsp, ElementId, Elements, InsertionOrder};
use isolux_core::units::Rgb;
use isolux_schedules::{Problem, corner_steps, sorting_depth};
use std::cell::RefCell;
use std::hint::black_box;
use std::rc::Rc;

/// Work that is run once, and what it counts for.
pub(crate) struct Sample<'a> {
    /// Classes that are fitted together have one group; after a colon, a kind of work within it.
    pub(crate) group: &'static str,
    pub(crate) counts: Vec<(&'static str, u64)>,
    pub(crate) run: Box<dyn FnMut() + 'a>,
}

/// Parts that the items of a group are cut into, each a sample.
const PARTS: usize = 8;
/// Pairs whose visibility is measured: some seconds under callgrind.
const VISIBILITIES: usize = 2_000;
/// Items of the cheaper kinds of work.
const ITEMS: usize = 20_000;

/// What a short solve leaves behind.
struct Solved<'a> {
    scene: &'a Scene,
    bsp: &'a Bsp,
    evaluator: Evaluator<'a>,
    elements: Elements,
    light: Light,
    parameters: Parameters,
    /// Receiver, link, and radiosity of its source.
    links: Vec<(ElementId, Link, Rgb)>,
    thresholds: Thresholds,
}

/// All samples of a scene.
pub(crate) fn of_scene(scene: &Scene) -> Result<Vec<Sample<'_>>, &'static str> {
    // Kept to the end of the program, as the samples are.
    let bsp: &Bsp = Box::leak(Box::new(Bsp::build(scene, InsertionOrder::AsGiven)));
    let solved: &Solved<'_> = Box::leak(Box::new(solve(scene, bsp)?));
    let mut samples = Vec::new();
    samples.extend(cuts(scene));
    samples.extend(form_factors(solved));
    samples.extend(visibilities(solved));
    samples.extend(decisions(solved));
    samples.extend(gathers(solved));
    samples.extend(sorts(solved));
    samples.extend(leaves(solved));
    samples.extend(means(solved));
    samples.extend(culls(solved));
    samples.extend(vertices(solved));
    samples.extend(tasks("queue:list", || List::new(SLOTS, |words| words), || List::new(SLOTS, Told::new)));
    samples.extend(tasks("queue:ring", || Ring::new(SLOTS, |words| words), || Ring::new(SLOTS, Told::new)));
    Ok(samples)
}

/// Two iterations by the paper's settings, fronts only.
fn solve<'a>(scene: &'a Scene, bsp: &'a Bsp) -> Result<Solved<'a>, &'static str> {
    let area: f64 = scene.polygons[..scene.fronts].iter().map(|polygon| polygon.area).sum();
    // Enough links for all samples, few enough for half a minute under callgrind.
    let bf = 0.2 * scene.emitted_power().mean() / area;
    let thresholds = Thresholds { bf, partial: 0.0, partial_form_factor: 1.0, emission: 1.0, area: 1e-3 * area };
    let parameters = Parameters {
        thresholds,
        stop: Stop::Change(0.0),
        update: Update::Jacobi,
        roots: Roots::Polygons,
        form_factor: FormFactor::Disks,
        sampling: Rays::Sixteen.into(),
        covered: Covered::Counted,
        seed: 0,
    };
    let active = vec![true; scene.fronts];
    let mut solver: Solver<'_, NoProbe> = Solver::with_active(scene, bsp, parameters, active);
    let _ = solver.link_roots(&mut Unobserved);
    for _ in 0..2 {
        solver.iterate(&mut Unobserved).ok_or("stopped")?;
    }
    let evaluator = solver.evaluator();
    let (hierarchy, ..) = solver.finish();
    let links = hierarchy.links.iter();
    let links: Vec<_> =
        links.map(|(receiver, link)| (receiver, *link, hierarchy.light.radiosity(link.source))).collect();
    if links.is_empty() {
        return Err("the scene has no links");
    }
    let (elements, light) = (hierarchy.elements, hierarchy.light);
    Ok(Solved { scene, bsp, evaluator, elements, light, parameters, links, thresholds })
}

impl Solved<'_> {
    /// At most `most` links, evenly spaced.
    fn some_links(&self, most: usize) -> Vec<(ElementId, Link, Rgb)> {
        let count = self.links.len().min(most);
        (0..count).map(|k| self.links[k * self.links.len() / count]).collect()
    }

    /// Links by receiver, with the radiosities of their sources; about [`ITEMS`] links in all.
    fn lists(&self) -> Vec<Vec<(Link, Rgb)>> {
        let lists = self.links.chunk_by(|(one, ..), (two, ..)| one == two);
        let lists: Vec<Vec<(Link, Rgb)>> =
            lists.map(|list| list.iter().map(|&(_, link, radiosity)| (link, radiosity)).collect()).collect();
        let step = self.links.len().div_ceil(ITEMS);
        lists.into_iter().step_by(step).collect()
    }
}

/// Cuts items into parts, keeping their order.
fn parts<T: Clone>(items: &[T]) -> impl Iterator<Item = Vec<T>> {
    items.chunks(items.len().div_ceil(PARTS).max(1)).map(<[T]>::to_vec)
}

/// Insertions in the BSP tree, for several orders, each in four parts.
fn cuts(scene: &Scene) -> Vec<Sample<'_>> {
    let orders = [InsertionOrder::AsGiven, InsertionOrder::LargestFirst, InsertionOrder::FewestCuts];
    let orders = orders.into_iter().chain((1..6).map(InsertionOrder::Random));
    let mut samples = Vec::new();
    for order in orders {
        let sequence = order.sequence(scene);
        let mut told = Bsp::new(scene);
        let tree = Rc::new(RefCell::new(Bsp::new(scene)));
        for part in sequence.chunks(sequence.len().div_ceil(4).max(1)) {
            let mut counts = Counts::default();
            for &polygon in part {
                told.insert_counted(polygon, &scene.polygons[polygon as usize].corners, &mut counts);
            }
            let (part, tree) = (part.to_vec(), Rc::clone(&tree));
            samples.push(Sample {
                group: "cut",
                counts: vec![("insert", part.len() as u64), ("cut", counts.cuts), ("split", counts.splits)],
                run: Box::new(move || {
                    let mut tree = tree.borrow_mut();
                    for &polygon in &part {
                        black_box(tree.insert(polygon, &scene.polygons[polygon as usize].corners));
                    }
                }),
            });
        }
    }
    samples
}

/// Form factors by four points and four disks, of receiver and source in their canonical order.
fn form_factors<'a>(solved: &'a Solved<'a>) -> Vec<Sample<'a>> {
    let pairs = solved.some_links(ITEMS / 4);
    let sample = |pairs: Vec<(ElementId, Link, Rgb)>| Sample {
        group: "form_factor",
        counts: vec![("form_factor", pairs.len() as u64)],
        run: Box::new(move || {
            for (receiver, link, _) in &pairs {
                let Solved { evaluator, elements, .. } = solved;
                black_box(evaluator.form_factor(elements, *receiver, link.source, &mut NoProbe));
            }
        }),
    };
    parts(&pairs).map(sample).collect()
}

/// Visibilities by single rays, grouped three times so that the counts vary between samples: by nodes, by fragments a
/// node, and by rays.
fn visibilities<'a>(solved: &'a Solved<'a>) -> Vec<Sample<'a>> {
    let walk = |(receiver, link, _): &(ElementId, Link, Rgb), probe: &mut dyn FnMut(Counts)| {
        let mut counts = Counts::default();
        shoot(solved, *receiver, link.source, &mut counts);
        probe(counts);
    };
    let mut told: Vec<((ElementId, Link, Rgb), Counts)> = Vec::new();
    for pair in solved.some_links(VISIBILITIES) {
        walk(&pair, &mut |counts| told.push((pair, counts)));
    }
    let mut samples = Vec::new();
    let keys: [fn(&Counts) -> f64; 3] = [
        |counts| counts.node_visits as f64,
        |counts| counts.fragment_tests as f64 / counts.node_visits.max(1) as f64,
        |counts| counts.rays as f64,
    ];
    for key in keys {
        told.sort_by(|(_, one), (_, two)| key(one).total_cmp(&key(two)));
        for part in parts(&told) {
            let mut sum = Counts::default();
            part.iter().for_each(|(_, counts)| sum.add(counts));
            samples.push(Sample {
                group: "visibility",
                counts: vec![
                    ("visibility", sum.visibilities),
                    ("ray", sum.rays),
                    ("node_visit", sum.node_visits),
                    ("fragment_test", sum.fragment_tests),
                ],
                run: Box::new(move || {
                    for ((receiver, link, _), _) in &part {
                        black_box(shoot(solved, *receiver, link.source, &mut NoProbe));
                    }
                }),
            });
        }
    }
    samples
}

/// A visibility of the pair by single rays.
fn shoot<P: Probe>(solved: &Solved<'_>, a: ElementId, b: ElementId, probe: &mut P) -> f64 {
    let Solved { scene, bsp, elements, .. } = solved;
    let names = [elements.get(a).path.to_bits(), elements.get(b).path.to_bits()];
    let seed = names.into_iter().fold(0, |seed, name| mix(seed ^ name));
    visibility_ray_by_ray(bsp, scene, &elements.patch(a), &elements.patch(b), Rays::Sixteen, seed, probe)
}

/// Decisions of the oracle, from a link's visibility and factor, the source's radiosity, and both areas.
fn decisions<'a>(solved: &'a Solved<'a>) -> Vec<Sample<'a>> {
    let Solved { scene, elements, thresholds, .. } = solved;
    let input = |(receiver, link, radiosity): (ElementId, Link, Rgb)| {
        let source = elements.get(link.source);
        let emission = scene.polygons[source.polygon as usize].emission;
        (link, [radiosity, emission], [elements.get(receiver).area, source.area])
    };
    let inputs: Vec<_> = solved.some_links(ITEMS).into_iter().map(input).collect();
    let sample = |inputs: Vec<(Link, [Rgb; 2], [f64; 2])>| Sample {
        group: "oracle",
        counts: vec![("oracle", inputs.len() as u64)],
        run: Box::new(move || {
            for (link, [radiosity, emission], areas) in &inputs {
                if let Some(sight) = link.sight() {
                    let light = [radiosity.mean(), emission.mean()];
                    black_box(bf_refinement(sight, link.form_factor, light, *areas, thresholds, &mut NoProbe));
                }
            }
        }),
    };
    parts(&inputs).map(sample).collect()
}

/// Gathers over whole lists.
fn gathers<'a>(solved: &'a Solved<'a>) -> Vec<Sample<'a>> {
    let sample = |lists: Vec<Vec<(Link, Rgb)>>| Sample {
        group: "gather",
        counts: vec![("gather", lists.iter().map(|list| list.len() as u64).sum())],
        run: Box::new(move || {
            for list in &lists {
                let terms = list.iter().map(|(link, radiosity)| *radiosity * link.weight());
                black_box(gather_sum(terms, Rgb::ZERO));
            }
        }),
    };
    parts(&solved.lists()).map(sample).collect()
}

/// Sorts of lists that come in no order, by their sources' paths.
fn sorts<'a>(solved: &'a Solved<'a>) -> Vec<Sample<'a>> {
    let mut stream = Stream::new(1);
    let shuffled = |list: Vec<(Link, Rgb)>| {
        let mut list: Vec<(f64, Link)> = list.into_iter().map(|(link, _)| (stream.next_unit(), link)).collect();
        list.sort_by(|(one, _), (two, _)| one.total_cmp(two));
        list.into_iter().map(|(_, link)| link).collect::<Vec<Link>>()
    };
    let lists: Vec<Vec<Link>> = solved.lists().into_iter().map(shuffled).collect();
    let sample = |mut lists: Vec<Vec<Link>>| Sample {
        group: "order",
        counts: vec![("order", lists.iter().map(|list| steps(list.len() as u64)).sum())],
        run: Box::new(move || {
            for list in &mut lists {
                list.sort_unstable_by_key(|link| solved.elements.get(link.source).path);
                black_box(list);
            }
        }),
    };
    parts(&lists).map(sample).collect()
}

/// What sorting a list counts for; 0 for a single link.
fn steps(count: u64) -> u64 {
    if count < 2 { 0 } else { count * sorting_depth(count) }
}

/// Leaves that settle.
fn leaves<'a>(solved: &'a Solved<'a>) -> Vec<Sample<'a>> {
    let irradiances: Vec<(u32, Rgb)> =
        solved.some_links(ITEMS).iter().map(|(id, _, light)| (solved.elements.get(*id).polygon, *light)).collect();
    let sample = |items: Vec<(u32, Rgb)>| Sample {
        group: "settle",
        counts: vec![("settle", items.len() as u64)],
        run: Box::new(move || {
            for &(polygon, irradiance) in &items {
                let polygon = &solved.scene.polygons[polygon as usize];
                black_box(reflected(polygon.emission, polygon.reflectance, irradiance));
            }
        }),
    };
    parts(&irradiances).map(sample).collect()
}

/// Elements that take the means of their children: radiosity and irradiance, by area.
fn means<'a>(solved: &'a Solved<'a>) -> Vec<Sample<'a>> {
    let elements = solved.elements.as_slice();
    let split = elements.iter().filter(|element| element.first_child != ElementId::NONE);
    let items: Vec<([f64; 4], f64, [Rgb; 8])> = split
        .take(ITEMS)
        .enumerate()
        .map(|(k, element)| {
            let areas = [0, 1, 2, 3].map(|child| elements[element.first_child.index() + child].area);
            (areas, element.area, std::array::from_fn(|at| solved.links[(8 * k + at) % solved.links.len()].2))
        })
        .collect();
    let sample = |items: Vec<([f64; 4], f64, [Rgb; 8])>| Sample {
        group: "pull",
        counts: vec![("pull", items.len() as u64)],
        run: Box::new(move || {
            for (areas, parent, values) in &items {
                let weights = area_weights(*areas, *parent);
                let [a, b, c, d, e, f, g, h] = *values;
                black_box((mean_of_children([a, b, c, d], weights), mean_of_children([e, f, g, h], weights)));
            }
        }),
    };
    parts(&items).map(sample).collect()
}

/// Pairs of roots that are asked whether they face each other, evenly spaced among all pairs.
fn culls<'a>(solved: &'a Solved<'a>) -> Vec<Sample<'a>> {
    let Solved { scene, bsp, parameters, .. } = solved;
    let active: Vec<bool> = (0..scene.polygons.len()).map(|polygon| polygon < scene.fronts).collect();
    // Fragments are the roots, as in the paper.
    let parameters = Parameters { roots: Roots::Fragments, ..*parameters };
    let problem: &Problem<'_> =
        Box::leak(Box::new(Problem::new(scene, bsp, InsertionOrder::AsGiven, parameters, &active)));
    let roots = &problem.active_roots;
    let pairs: Vec<(u32, u32)> =
        roots.iter().enumerate().flat_map(|(at, &a)| roots[..at].iter().map(move |&b| (a, b))).collect();
    let count = pairs.len().min(ITEMS);
    let pairs: Vec<(u32, u32)> = (0..count).map(|k| pairs[k * pairs.len() / count]).collect();
    let sample = |pairs: Vec<(u32, u32)>| Sample {
        group: "cull",
        counts: vec![("cull", pairs.len() as u64)],
        run: Box::new(move || {
            for &(a, b) in &pairs {
                black_box(problem.face_each_other(a, b));
            }
        }),
    };
    parts(&pairs).map(sample).collect()
}

/// Values at the corners of leaves, leaves grouped by depth.
fn vertices<'a>(solved: &'a Solved<'a>) -> Vec<Sample<'a>> {
    let elements = &solved.elements;
    let mut leaves: Vec<ElementId> = elements.leaves().collect();
    leaves.sort_by_key(|&leaf| elements.get(leaf).path.depth());
    let step = leaves.len().div_ceil(ITEMS / 8);
    let leaves: Vec<ElementId> = leaves.into_iter().step_by(step).collect();
    let sample = |part: Vec<ElementId>| {
        let mut steps = 0;
        for &leaf in &part {
            at_corners(solved, leaf, |points, levels| steps += corner_steps(points, levels));
        }
        Sample {
            group: "interpolate",
            counts: vec![("interpolate", steps)],
            run: Box::new(move || {
                for &leaf in &part {
                    at_corners(solved, leaf, |_, _| ());
                }
            }),
        }
    };
    parts(&leaves).map(sample).collect()
}

/// Means over the leaves around each corner of a leaf; tells of each corner how many points were located, and how many
/// levels that took in all.
fn at_corners(solved: &Solved<'_>, leaf: ElementId, mut told: impl FnMut(u64, u64)) {
    let Solved { scene, elements, light, .. } = solved;
    let element = elements.get(leaf);
    let root = ElementId(element.path.root_index());
    let (outline, normal) = (&elements.get(root).corners, scene.polygons[element.polygon as usize].plane.normal);
    for corner in 0..element.corners.len() {
        // At most six sectors.
        let (mut around, mut values, mut count) = ([root; 6], [Rgb::ZERO; 6], 0);
        let (mut points, mut levels) = (0, 0);
        for point in around_corner(&element.corners, corner, outline, normal) {
            let found = elements.locate(root, point);
            points += 1;
            levels += u64::from(elements.get(found).path.depth());
            if !around[..count].contains(&found) {
                (around[count], values[count]) = (found, light.radiosity(found));
                count += 1;
            }
        }
        told(points, levels);
        black_box(corner_mean(&values[..count]));
    }
}

/// Tasks that are put in a queue and taken out again, in bursts: two ways each. `moved`: words loaded and stored.
fn tasks<'a, Q, T>(group: &'static str, queue: fn() -> Q, told: fn() -> T) -> Vec<Sample<'a>>
where
    Q: Queue + 'static,
    T: Queue<Words = Told>,
{
    let sample = |burst| {
        let mut told = told();
        move_tasks(&mut told, burst);
        let mut queue = queue();
        Sample {
            group,
            counts: vec![("queue", 2 * ROUNDS * burst), ("moved", told.words().moved())],
            run: Box::new(move || move_tasks(&mut queue, burst)),
        }
    };
    [1, 2, 4, 8, 16, 32, 64, 128].into_iter().map(sample).collect()
}

/// How often a burst of tasks is put in and taken out.
const ROUNDS: u64 = 20;
/// More than the longest burst.
const SLOTS: usize = 200;

fn move_tasks(queue: &mut impl Queue, burst: u64) {
    for round in 0..ROUNDS {
        for k in 0..burst {
            black_box(queue.put(black_box(&[round, k, 1])));
        }
        for _ in 0..burst {
            black_box(queue.take());
        }
    }
}
