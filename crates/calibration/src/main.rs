//! Samples of kernel work for callgrind: a scene file goes in; each sample of each kind of work is run once inside
//! [`measured`], and what it did is written out. Counting instructions and fitting figures are left to
//! `benches/cost_model.py`.

mod queue;
mod samples;

use isolux_core::scene::{BuildOptions, Scene};
use samples::{Sample, of_scene};
use std::error::Error;
use std::hint::black_box;
use std::io::Write;

/// Instructions are collected in here only, and written to a file of their own at each return: callgrind is told so by
/// this name.
#[inline(never)]
fn measured(work: &mut dyn FnMut()) {
    black_box(work)();
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args_os().nth(1).ok_or("usage: isolux-calibration SCENE")?;
    let input = isolux_formats::read::read(path.as_ref(), &Default::default())?;
    let scene = Scene::build(input, &BuildOptions::default())?;
    let mut out = std::io::stdout().lock();
    for Sample { group, counts, mut run } in of_scene(&scene)? {
        measured(&mut *run);
        write!(out, "{group}")?;
        for (class, count) in counts {
            write!(out, " {class}={count}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}
