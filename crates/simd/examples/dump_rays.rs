//! Writes the scenes and packets of the bench `rays` for another program to measure: see `benches/embree.c`.
//!
//! `cargo run --release -p isolux-simd --example dump_rays -- DIRECTORY` makes SCENE-ORDER.bin, little-endian: number of
//! triangles, their corners; number of packets, of each origins, directions, near and far of its 16 rays (axis by axis) and
//! our answer. What it prints are our nanoseconds per packet: the fastest of 50 runs over all packets.

#[path = "../benches/scenes/mod.rs"]
#[allow(unreachable_pub, dead_code)]
mod scenes;

use isolux_simd::bvh::Bvh8;
use isolux_simd::lanes::Backend;
use scenes::{dense, packets, pairs, refined, room, triangles};
use std::io::Write;
use std::time::Instant;

#[allow(clippy::print_stdout)]
fn main() -> std::io::Result<()> {
    let directory = std::env::args().nth(1).unwrap_or_else(|| ".".into());
    for (name, primitives) in [("room", room()), ("dense", dense())] {
        let bvh = Bvh8::build(&primitives);
        let some = pairs(&primitives, 4096, 1);
        let fine = refined(&some[..256]);
        for (order, pairs) in [("random", some), ("refined", fine)] {
            let packets = packets(&pairs, 2);
            let mut answers = vec![0; packets.len()];
            let mut best = f64::INFINITY;
            for _ in 0..50 {
                let start = Instant::now();
                bvh.blocked_batch(Backend::best(), &packets, &mut answers);
                best = best.min(start.elapsed().as_secs_f64());
            }
            println!("{name}-{order}: {:.0} ns", best * 1e9 / packets.len() as f64);
            let mut bytes = Vec::new();
            let triangles = triangles(&primitives);
            bytes.extend((triangles.len() as u32).to_le_bytes());
            bytes.extend(triangles.iter().flatten().flatten().flat_map(|x| x.to_le_bytes()));
            bytes.extend((packets.len() as u32).to_le_bytes());
            for (rays, &answer) in packets.iter().zip(&answers) {
                let axes = rays.origin.iter().chain(&rays.direction).flatten();
                bytes.extend(axes.chain(&rays.near).chain(&rays.far).flat_map(|x| x.to_le_bytes()));
                bytes.extend(u32::from(answer).to_le_bytes());
            }
            std::fs::File::create(format!("{directory}/{name}-{order}.bin"))?.write_all(&bytes)?;
        }
    }
    Ok(())
}
