//! Stages of refinement and gathering until what the links leave is below the error that was asked for.

use crate::clusters::Clusters;
use crate::contacts::{Contacts, mark};
use crate::geometry::Geometry;
use crate::light::{Light, rms};
use crate::link::CLUSTER;
use crate::rounds::{Limit, Remaining, Transport};
use isolux_core::scene::Scene;
use std::sync::Arc;

/// What a solve is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Request {
    /// RMS error of irradiance over all surfaces, relative to its mean.
    pub error: f64,
    /// Least area of elements that are split, share of the scene's.
    pub least_area: f64,
    /// Seed of every pseudo-random choice.
    pub seed: u64,
}

/// One stage of a solve.
#[derive(Clone, Copy, Debug)]
pub struct Stage {
    /// Elements so far.
    pub elements: usize,
    /// Links that carry light.
    pub links: usize,
    /// Links whose rays are all blocked.
    pub dark: usize,
    /// Gathers.
    pub passes: u32,
    /// Estimated relative error.
    pub estimate: f64,
    /// Its parts: receiver, source, noise, bulge, dark.
    pub parts: [f64; 5],
    /// Evaluated pairs so far.
    pub evaluated: u64,
    /// Packets beyond.
    pub packets: u64,
    /// Seconds of refinement and gathers.
    pub seconds: [f64; 2],
}

/// A solved scene.
pub struct Solved {
    pub(crate) geometry: Arc<Geometry>,
    pub(crate) transport: Transport,
    pub(crate) light: Light,
    /// What happened.
    pub stages: Vec<Stage>,
}

/// The parts of a scene that a solve works on, made once.
pub struct Prepared {
    pub(crate) geometry: Arc<Geometry>,
    pub(crate) clusters: Arc<Clusters>,
}

impl Prepared {
    /// Builds the trees.
    #[must_use]
    pub fn new(scene: Arc<Scene>) -> Prepared {
        let fronts = scene.fronts;
        let mut geometry = Geometry::new(scene);
        let roots = geometry.bare_roots();
        let active: Vec<bool> = (0..roots.len()).map(|polygon| polygon < fronts).collect();
        let clusters = Arc::new(Clusters::new(&roots, &active));
        geometry.contacts = Contacts::new(&geometry, &clusters, &roots);
        let geometry = Arc::new(geometry);
        Prepared { geometry, clusters }
    }

    /// Solves.
    #[must_use]
    pub fn solve(&self, request: &Request) -> Solved {
        let Prepared { geometry, clusters } = self;
        let scene = &*geometry.scene;
        let mut elements = geometry.bare_roots();
        mark(&mut elements, geometry);
        let area: f64 = scene.area();
        // As if all that is emitted fell evenly on everything, and what is reflected again and again.
        let reflectance: f64 =
            scene.polygons[..scene.fronts].iter().map(|p| p.reflectance.mean() * p.area).sum::<f64>() / area;
        let guess = scene.emitted_power().0.map(|power| (power / area / (1.0 - reflectance.min(0.9))) as f32);
        let mut light = Light::even(guess, geometry, clusters, &elements);
        let mut transport = Transport {
            geometry: geometry.clone(),
            clusters: clusters.clone(),
            elements,
            links: Vec::new(),
            dark: Vec::new(),
            alone: vec![CLUSTER],
            seed: request.seed,
            evaluated: 0,
            packets: 0,
        };
        let mut stages = Vec::new();
        let mut mean = f64::from(rms(guess));
        let mut aim = 0.5_f64.max(request.error);
        // Links that share the error, to begin with.
        let mut share = 1.0 / 1000.0;
        for _ in 0..40 {
            let limit = Limit {
                error: (aim * aim * mean * mean * area * share) as f32,
                area: (request.least_area * area) as f32,
            };
            let start = std::time::Instant::now();
            transport.refine(&mut light, limit);
            let refined = start.elapsed().as_secs_f64();
            let mut passes = 0;
            let mut settles = 0;
            loop {
                passes += converge(&mut light, &transport, 0.05 * request.error);
                let before: Vec<f32> = light.radiosity.iter().map(|&b| rms(b)).collect();
                light.settle(&transport.links, 0.25 * limit.error, &transport.evaluator());
                settles += 1;
                let (mut change, mut sum) = (0.0_f64, 0.0_f64);
                for (index, element) in
                    transport.elements.iter().enumerate().filter(|(_, e)| e.first_child == crate::geometry::NONE)
                {
                    let now = rms(light.radiosity[index]);
                    change += f64::from(element.area * (now - before[index]) * (now - before[index]));
                    sum += f64::from(element.area * now);
                }
                let relative = (change / area).sqrt() / (sum / area);
                eprintln!("   settle change {relative:.5}");
                if relative < 0.2 * request.error || settles >= 5 {
                    break;
                }
            }
            mean = mean_irradiance(&light, scene, &transport);
            light.scale = mean as f32;
            let left = transport.remaining(&mut light);
            let Remaining { receiver, source, noise, bulge, dark } = left;
            let relative = |square: f64| (square / area).sqrt() / mean;
            let sum = receiver + bulge + source + noise + dark;
            let estimate = relative(sum);
            stages.push(Stage {
                elements: transport.elements.len(),
                links: transport.links.len(),
                dark: transport.dark.len(),
                passes,
                estimate,
                parts: [receiver, source, noise, bulge, dark].map(relative),
                evaluated: transport.evaluated,
                packets: transport.packets,
                seconds: [refined, start.elapsed().as_secs_f64() - refined],
            });
            let start = std::time::Instant::now();
            let found = crate::check::check(geometry, &transport.elements, &light, request.seed);
            eprintln!("check {found:.4?} {:.4}", start.elapsed().as_secs_f64());
            if estimate <= request.error {
                break;
            }
            transport.refine_leaves(&mut light, limit);
            // What the limit would have to be if the number of links stayed.
            share *= (request.error / estimate).powi(2).clamp(0.03, 0.5);
            aim = aim.max(request.error);
        }
        Solved { geometry: geometry.clone(), transport, light, stages }
    }
}

/// Gathers until what further passes would change is below `error` of the mean; returns their number.
fn converge(light: &mut Light, transport: &Transport, error: f64) -> u32 {
    let evaluator = transport.evaluator();
    let total = |light: &Light| -> f64 { f64::from(light.cluster_radiosity[0]) };
    let (mut before, mut last) = (total(light), f64::INFINITY);
    for pass in 1..=100 {
        light.pass(&transport.links, &evaluator);
        let now = total(light);
        let change = (now - before).abs();
        let ratio = if last.is_finite() && last > 0.0 { (change / last).min(0.99) } else { 0.9 };
        if change == 0.0 || change * ratio / (1.0 - ratio) <= error * now && pass > 2 {
            return pass;
        }
        (before, last) = (now, change);
    }
    100
}

fn mean_irradiance(light: &Light, scene: &Scene, transport: &Transport) -> f64 {
    let polygons = &transport.elements[..scene.fronts];
    let sum: f64 = polygons
        .iter()
        .zip(&light.irradiance)
        .zip(&light.open)
        .map(|((root, h), open)| f64::from(root.area * open) * f64::from(h[0] + h[1] + h[2]) / 3.0)
        .sum();
    sum / scene.area()
}

impl Prepared {
    /// dev
    pub fn probe(&self) {
        let mut elements = self.geometry.bare_roots();
        let n = elements.len();
        for i in 0..n {
            let f = crate::contacts::split(&mut elements, i as u32, &self.geometry);
            for k in 0..4 {
                let g = crate::contacts::split(&mut elements, f + k, &self.geometry);
                for l in 0..4 {
                    crate::contacts::split(&mut elements, g + l, &self.geometry);
                }
            }
        }
        let leaves: Vec<u32> = (0..elements.len() as u32).filter(|&i| elements[i as usize].path.depth() == 2).collect();
        for p in [0u32, 5, 7, 17, 6] {
            let (mut sum, mut area, mut unocc) = (0.0f64, 0.0f64, 0.0f64);
            for &i in &leaves {
                if elements[i as usize].polygon != p {
                    continue;
                }
                area += elements[i as usize].area as f64;
                for &j in &leaves {
                    let mut acc = 0.0;
                    for seed in 0..4 {
                        let evaluator = crate::evaluate::Evaluator {
                            geometry: &self.geometry,
                            clusters: &self.clusters,
                            elements: &elements,
                            seed,
                        };
                        let mut last = u32::MAX;
                        if let [Some(l), _] = evaluator.pair(i, j, 3, false, &mut last) {
                            if !l.state.is(crate::link::State::DARK) {
                                acc += crate::field::mean(&l.factors, elements[i as usize].count) as f64 / 4.0;
                            }
                        }
                        if seed == 0 {
                            let (a, _) = evaluator.exchange(&elements[i as usize], &elements[j as usize]);
                            unocc += crate::field::mean(&a, 4) as f64 * elements[i as usize].area as f64;
                        }
                    }
                    sum += acc * elements[i as usize].area as f64;
                }
            }
            eprintln!("polygon {p}: row sum {:.4} unoccluded {:.4}", sum / area, unocc / area);
        }
    }
}

impl Solved {
    fn prepared_clusters(&self) -> &Clusters {
        &self.transport.clusters
    }
    /// dev
    pub fn dump(&self) {
        let n = self.transport.links.len();
        let partial = self.transport.links.iter().filter(|l| l.state.visibility < 255).count();
        let clear = self.transport.links.iter().filter(|l| l.state.is(8)).count();
        let cl = self.transport.links.iter().filter(|l| (l.source | l.receiver) >> 31 == 1).count();
        eprintln!("links {n} partial {partial} clear {clear} clusters {cl}");
        // row sums at leaves' middles and corners
        let mut t =
            crate::light::Light::even([1.0; 3], &self.geometry, self.prepared_clusters(), &self.transport.elements);
        t.radiosity.iter_mut().for_each(|b| *b = [1.0; 3]);
        t.slope.iter_mut().for_each(|b| *b = [[0.0; 3]; 2]);
        t.deviation.iter_mut().for_each(|b| *b = [0.0; 2]);
        t.settle(&self.transport.links, 0.0, &self.transport.evaluator());
        for p in 0..self.geometry.scene.fronts {
            let mut t =
                crate::light::Light::even([0.0; 3], &self.geometry, self.prepared_clusters(), &self.transport.elements);
            let e = &self.transport.elements;
            for i in 0..e.len() {
                t.radiosity[i] = if e[i].polygon == p as u32 { [1.0; 3] } else { [0.0; 3] };
                t.slope[i] = [[0.0; 3]; 2];
                t.deviation[i] = [0.0; 2];
            }
            t.settle(&self.transport.links, 0.0, &self.transport.evaluator());
            let mut sum = 0.0;
            for i in 0..e.len() {
                if e[i].first_child == u32::MAX {
                    sum += e[i].area * crate::light::mean(&t.field[i], e[i].count)[0];
                }
            }
            eprint!("{p}>{:.4} ", sum / e[p].area);
        }
        eprintln!("column sums");
        let e = &self.transport.elements;
        let (mut a, mut s, mut q) = (0.0, 0.0, 0.0);
        for i in 0..e.len() {
            if e[i].first_child == u32::MAX {
                let m = crate::light::mean(&t.field[i], e[i].count)[0];
                a += e[i].area;
                s += e[i].area * m;
                q += e[i].area * (m - 1.0) * (m - 1.0);
            }
        }
        {
            let mut worst: Vec<(f32, usize)> = (0..e.len())
                .filter(|&i| e[i].first_child == u32::MAX)
                .map(|i| (e[i].area * (crate::light::mean(&t.field[i], e[i].count)[0] - 1.0), i))
                .collect();
            worst.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
            for &(w, i) in worst.iter().take(25) {
                eprintln!(
                    "leaf poly {} depth {} centre {:.2?} r {:.2} deficit*area {w:.4} field {:.3?}",
                    e[i].polygon,
                    e[i].path.depth(),
                    e[i].centre().as_dvec3() + self.geometry.middle,
                    e[i].radius(),
                    t.field[i].map(|f| f[0])
                );
            }
        }
        for p in 0..self.geometry.scene.fronts {
            let (mut a, mut s) = (0.0, 0.0);
            for i in 0..e.len() {
                if e[i].first_child == u32::MAX && e[i].polygon == p as u32 {
                    let m = crate::light::mean(&t.field[i], e[i].count)[0];
                    a += e[i].area;
                    s += e[i].area * m;
                }
            }
            eprint!("{p}:{:.3} ", s / a);
        }
        eprintln!("row sums mean {} rms {}", s / a, (q / a).sqrt());
        if let Ok(at) = std::env::var("AT") {
            let v: Vec<f32> = at.split(',').map(|x| x.parse().unwrap()).collect();
            let p = (isolux_core::DVec3::new(v[1] as f64, v[2] as f64, v[3] as f64) - self.geometry.middle).as_vec3();
            let polygon = self.geometry.scene.face_polygon[v[0] as usize];
            let mut i = crate::read::leaf(self, polygon, p);
            let e = &self.transport.elements;
            eprintln!(
                "leaf depth {} corners {:?} field {:.3?}",
                e[i].path.depth(),
                e[i].corners.map(|c| c.as_dvec3() + self.geometry.middle),
                self.light.field[i].map(|f| f[0])
            );
            let leaf = e[i];
            loop {
                eprintln!(" level {} ", e[i].path.depth());
                for l in self.transport.links.iter().filter(|l| l.receiver == i as u32) {
                    if l.source >> 31 == 1 {
                        eprintln!("cluster {:?}", l.factors);
                        continue;
                    }
                    let s = &e[l.source as usize];
                    let ev = self.transport.evaluator();
                    let f = ev.factors(&leaf, s);
                    eprintln!(
                        "   <- poly {} depth {} centre {:.2?} r {:.2} v {} B {:.3} slope {:.2?} {:.2?} dev {:.2?} c {:.2?} val {:.3} F {:.4?}",
                        s.polygon,
                        s.path.depth(),
                        s.centre().as_dvec3() + self.geometry.middle,
                        s.radius(),
                        l.state.visibility,
                        self.light.radiosity[l.source as usize][0],
                        self.light.slope[l.source as usize][0][0],
                        self.light.slope[l.source as usize][1][0],
                        self.light.deviation[l.source as usize],
                        l.state.centre(),
                        self.light.value(l, &ev)[0],
                        f
                    );
                }
                if e[i].parent == u32::MAX {
                    break;
                }
                i = e[i].parent as usize;
            }
        }
        let e = &self.transport.elements;
        let mut worst: Vec<(f32, usize)> = (0..e.len())
            .filter(|&i| e[i].first_child == u32::MAX)
            .map(|i| ((self.light.field[i][4][0] - 2.0).abs(), i))
            .collect();
        worst.sort_by(|a, b| b.0.total_cmp(&a.0));
        for &(w, i) in worst.iter().take(0) {
            eprintln!(
                "leaf {i} poly {} depth {} err {w} field {:.3?}",
                e[i].polygon,
                e[i].path.depth(),
                self.light.field[i].map(|f| f[0])
            );
            let mut at = i;
            loop {
                eprintln!(
                    " level {} corners {:.3?} mid {:.3?}",
                    e[at].path.depth(),
                    &e[at].corners[..2],
                    e[at].centre()
                );
                let mut sum = [0.0; 5];
                for l in self.transport.links.iter().filter(|l| l.receiver == at as u32) {
                    for k in 0..5 {
                        sum[k] += l.factors[k] * self.light.radiosity[l.source as usize][0];
                    }
                    eprintln!(
                        "   <- {} poly {} depth {} v {} B {:.3} {:.4?}",
                        l.source,
                        e[l.source as usize].polygon,
                        e[l.source as usize].path.depth(),
                        l.state.visibility,
                        self.light.radiosity[l.source as usize][0],
                        l.factors
                    );
                }
                eprintln!("   sum {sum:.4?}");
                if e[at].parent == u32::MAX {
                    break;
                }
                at = e[at].parent as usize;
            }
        }
    }
}
