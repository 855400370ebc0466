//! The hierarchy above polygons: groups that exchange light as one.

use crate::geometry::{Element, Geometry, NONE};
use crate::light::Directional;
use glam::Vec3;

/// A group of polygons that lie together, as a range of [`Clusters::order`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cluster {
    pub(crate) low: Vec3,
    pub(crate) high: Vec3,
    /// Mean of the members' middles, by area.
    pub(crate) centre: Vec3,
    /// Radius about the middle that holds all members, metres.
    pub(crate) radius: f32,
    /// Sum of the members' areas, m².
    pub(crate) area: f32,
    pub(crate) first: u32,
    pub(crate) count: u32,
    pub(crate) parent: u32,
    /// The second child; the first one comes directly after its parent. 0: a cluster whose children are polygons.
    pub(crate) second: u32,
}

/// Polygons in one hierarchy. A parent comes before its children, all below the first child before the second.
pub(crate) struct Clusters {
    pub(crate) nodes: Vec<Cluster>,
    /// Polygons, those of each cluster side by side.
    pub(crate) order: Vec<u32>,
    /// The cluster without clusters below it that each polygon is a member of; none of those that are in no cluster.
    pub(crate) home: Vec<u32>,
    /// Area before each entry of `order`, and in all, m².
    area_before: Vec<f64>,
}

/// Most polygons of a cluster that has no clusters below it.
const LEAF: usize = 4;

/// Bins of the surface area heuristic.
const BINS: usize = 16;

/// Polygons from which halves are built side by side.
const PARALLEL: usize = 20_000;

/// Clusters below the first half of one from which on both halves are passed to side by side.
const PASSED: usize = 1024;

impl Clusters {
    /// Groups the `active` polygons. `roots`: the elements of all polygons.
    pub(crate) fn new(roots: &[Element], active: &[bool]) -> Clusters {
        let mut order: Vec<u32> = (0..roots.len() as u32).filter(|&polygon| active[polygon as usize]).collect();
        let boxes: Vec<(Vec3, Vec3)> = roots
            .iter()
            .map(|root| {
                root.corners.iter().fold((root.corners[0], root.corners[0]), |(low, high), &corner| {
                    (low.min(corner), high.max(corner))
                })
            })
            .collect();
        let mut nodes = build(&boxes, &mut order, 0);
        let parents: Vec<u32> = {
            let mut parents = vec![u32::MAX; nodes.len()];
            for (index, node) in nodes.iter().enumerate().filter(|(_, node)| node.second != 0) {
                parents[index + 1] = index as u32;
                parents[node.second as usize] = index as u32;
            }
            parents
        };
        let mut sums = vec![(Vec3::ZERO, 0.0_f32); nodes.len()];
        for index in (0..nodes.len()).rev() {
            let node = nodes[index];
            sums[index] = if node.second == 0 {
                let members = &order[node.first as usize..(node.first + node.count) as usize];
                members.iter().fold((Vec3::ZERO, 0.0), |(sum, area), &polygon| {
                    let root = &roots[polygon as usize];
                    (sum + root.centre() * root.area, area + root.area)
                })
            } else {
                let ((a, x), (b, y)) = (sums[index + 1], sums[node.second as usize]);
                (a + b, x + y)
            };
        }
        for (index, node) in nodes.iter_mut().enumerate() {
            let (sum, area) = sums[index];
            node.area = area;
            node.parent = parents[index];
            node.centre = sum / area;
            node.radius = (node.high - node.centre).abs().max((node.centre - node.low).abs()).length();
        }
        Clusters::from_parts(nodes, order, roots)
    }

    /// From nodes and members that fit together.
    pub(crate) fn from_parts(nodes: Vec<Cluster>, order: Vec<u32>, roots: &[Element]) -> Clusters {
        let mut area_before = Vec::with_capacity(order.len() + 1);
        let mut sum = 0.0;
        for &polygon in &order {
            area_before.push(sum);
            sum += f64::from(roots[polygon as usize].area);
        }
        area_before.push(sum);
        let mut home = vec![NONE; roots.len()];
        for (index, node) in nodes.iter().enumerate().filter(|(_, node)| node.second == 0) {
            for &polygon in &order[node.first as usize..(node.first + node.count) as usize] {
                home[polygon as usize] = index as u32;
            }
        }
        Clusters { nodes, order, home, area_before }
    }

    /// Bytes that it takes.
    pub(crate) fn memory(&self) -> usize {
        size_of_val(&self.nodes[..])
            + size_of_val(&self.order[..])
            + size_of_val(&self.home[..])
            + size_of_val(&self.area_before[..])
    }

    /// Adds to every cluster what those above it have, by channels of a function of direction.
    pub(crate) fn pass_down<const C: usize>(&self, arriving: &mut [Directional<C>]) {
        self.pass_below(0, arriving);
    }

    /// The same from cluster `first` on, whose own value comes first in `arriving`.
    fn pass_below<const C: usize>(&self, first: usize, arriving: &mut [Directional<C>]) {
        let second = self.nodes[first].second as usize;
        if second == 0 {
            return;
        }
        let above = arriving[0];
        let (one, other) = arriving[1..].split_at_mut(second - first - 1);
        for child in [&mut one[0], &mut other[0]] {
            for (own, above) in child.iter_mut().zip(above) {
                (0..C).for_each(|c| own[c] += above[c]);
            }
        }
        if one.len() >= PASSED {
            rayon::join(|| self.pass_below(first + 1, one), || self.pass_below(second, other));
        } else {
            self.pass_below(first + 1, one);
            self.pass_below(second, other);
        }
    }

    /// Members of a cluster.
    pub(crate) fn members(&self, cluster: u32) -> &[u32] {
        let node = &self.nodes[cluster as usize];
        &self.order[node.first as usize..(node.first + node.count) as usize]
    }

    /// The member that holds a share in [0, 1) of the cluster's area.
    pub(crate) fn member_at(&self, cluster: u32, share: f32) -> u32 {
        let node = &self.nodes[cluster as usize];
        let range = node.first as usize..(node.first + node.count) as usize;
        let (from, to) = (self.area_before[range.start], self.area_before[range.end]);
        let wanted = from + (to - from) * f64::from(share);
        let before = self.area_before[range.clone()].partition_point(|&before| before <= wanted);
        self.order[range.start + before.saturating_sub(1)]
    }

    /// How far in front of a plane the cluster's box reaches, metres.
    pub(crate) fn reach(&self, cluster: u32, geometry: &Geometry, polygon: u32) -> f32 {
        let node = &self.nodes[cluster as usize];
        let surface = &geometry.surfaces[polygon as usize];
        let (middle, half) = ((node.low + node.high) * 0.5, (node.high - node.low) * 0.5);
        surface.normal.dot(middle) - surface.offset + surface.normal.abs().dot(half)
    }
}

fn half_area(low: Vec3, high: Vec3) -> f32 {
    let size = high - low;
    size.x * size.y + size.y * size.z + size.z * size.x
}

/// Clusters of `order`, whose entries begin at `first` of the whole; sorts it so that members lie side by side.
fn build(boxes: &[(Vec3, Vec3)], order: &mut [u32], first: u32) -> Vec<Cluster> {
    let of = |polygon: u32| boxes[polygon as usize];
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (mut least, mut most) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for &polygon in order.iter() {
        let (l, h) = of(polygon);
        (low, high) = (low.min(l), high.max(h));
        (least, most) = (least.min(l + h), most.max(l + h));
    }
    let (centre, count) = ((low + high) * 0.5, order.len() as u32);
    let node = Cluster { low, high, centre, radius: 0.0, area: 0.0, first, count, parent: u32::MAX, second: 0 };
    if order.len() <= LEAF {
        return vec![node];
    }
    let middle = divide(boxes, order, least, most);
    let (left, right) = order.split_at_mut(middle);
    let after = first + middle as u32;
    let (mut left, right) = if left.len() + right.len() >= PARALLEL {
        rayon::join(|| build(boxes, left, first), || build(boxes, right, after))
    } else {
        (build(boxes, left, first), build(boxes, right, after))
    };
    let mut nodes = Vec::with_capacity(1 + left.len() + right.len());
    let second = 1 + left.len() as u32;
    nodes.push(Cluster { second, ..node });
    let shifted =
        |by: u32| move |node: Cluster| Cluster { second: if node.second == 0 { 0 } else { node.second + by }, ..node };
    nodes.extend(left.drain(..).map(shifted(1)));
    nodes.extend(right.into_iter().map(shifted(second)));
    nodes
}

/// Sorts `order` into two halves at the plane with the least cost by surface area; returns the size of the first.
fn divide(boxes: &[(Vec3, Vec3)], order: &mut [u32], least: Vec3, most: Vec3) -> usize {
    let size = most - least;
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    let extent = size[axis];
    let bin = |polygon: u32| {
        let (low, high) = boxes[polygon as usize];
        (((low[axis] + high[axis] - least[axis]) / extent * BINS as f32) as usize).min(BINS - 1)
    };
    let half = order.len() / 2;
    if extent > 0.0 {
        let mut bins = [(Vec3::INFINITY, Vec3::NEG_INFINITY, 0usize); BINS];
        for &polygon in order.iter() {
            let (low, high) = boxes[polygon as usize];
            let entry = &mut bins[bin(polygon)];
            *entry = (entry.0.min(low), entry.1.max(high), entry.2 + 1);
        }
        let sweep = |bins: &mut dyn Iterator<Item = &(Vec3, Vec3, usize)>| -> Vec<f32> {
            let mut sum = (Vec3::INFINITY, Vec3::NEG_INFINITY, 0usize);
            bins.map(|&(low, high, count)| {
                sum = (sum.0.min(low), sum.1.max(high), sum.2 + count);
                if sum.2 == 0 { 0.0 } else { half_area(sum.0, sum.1) * sum.2 as f32 }
            })
            .collect()
        };
        let (up, down) = (sweep(&mut bins.iter()), sweep(&mut bins.iter().rev()));
        let cost = |cut: usize| up[cut - 1] + down[BINS - 1 - cut];
        let cut = (1..BINS).min_by(|&a, &b| cost(a).total_cmp(&cost(b))).unwrap_or(BINS / 2);
        let mut from = 0;
        for index in 0..order.len() {
            if bin(order[index]) < cut {
                order.swap(index, from);
                from += 1;
            }
        }
        if from > 0 && from < order.len() {
            return from;
        }
    }
    half
}
