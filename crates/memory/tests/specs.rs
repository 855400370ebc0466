//! Spec files: the two that come with the crate, and one clear error for everything that can be wrong with another.

#![allow(clippy::unwrap_used, reason = "tests")]

use isolux_memory::{CacheSpec, Level, Spec, SpecError};

const SOUND: &str = "
name = 'sound'
clock_mhz = 100
clusters = 4
processors_per_cluster = 2
line_bytes = 32
word_bytes = 8
[first_level]
bytes = 1024
ways = 2
[second_level]
bytes = 4096
ways = 4
[latency]
first_level = 1
second_level = 4
neighbour = 20
local_memory = 30
remote_memory = 90
remote_cache = 80
third_cluster = 120
";

/// D23, D24. Would catch a figure that drifts from what the sources in the file say.
#[test]
fn dash_has_its_published_figures() {
    let dash = Spec::dash().unwrap();
    assert_eq!((dash.clusters(), dash.processors_per_cluster(), dash.processors()), (16, 4, 64));
    assert_eq!(
        (dash.line_bytes(), dash.first_level(), dash.second_level()),
        (16, CacheSpec { bytes: 256 << 10, ways: 1 }, None)
    );
    let clocks = Level::ALL.map(|level| dash.latency().clocks(level));
    assert_eq!(clocks, [1, 0, 30, 30, 100, 100, 135]);
}

/// Would catch nanoseconds that were turned into clocks wrongly.
#[test]
fn two_socket_has_its_measured_figures() {
    let server = Spec::two_socket().unwrap();
    assert_eq!((server.clusters(), server.processors_per_cluster(), server.line_bytes()), (2, 28, 64));
    let clocks = |nanoseconds: f64| (nanoseconds * f64::from(server.clock_mhz()) / 1000.0).round() as u32;
    assert_eq!(server.latency().clocks(Level::Neighbour), clocks(49.3));
    assert_eq!(server.latency().clocks(Level::LocalMemory), clocks((80.8 + 81.5) / 2.0));
    assert_eq!(server.latency().clocks(Level::RemoteMemory), clocks((140.4 + 141.6) / 2.0));
    assert_eq!(server.latency().clocks(Level::RemoteCache), clocks((114.1 + 113.2 + 114.0 + 113.5) / 4.0));
    assert_eq!(server.latency().clocks(Level::ThirdCluster), 0);
}

/// Would catch a check that lets an absurd figure through, or blames another; each row alters one line of a sound file.
#[test]
fn every_wrong_figure_is_named() {
    assert_eq!(Spec::parse("sound.toml", SOUND).unwrap().processors(), 8);
    for (line, instead, message) in [
        ("clusters = 4", "clusters = 0", "clusters = 0: must lie in 1 to 64"),
        ("clusters = 4", "clusters = 65", "clusters = 65: must lie in 1 to 64"),
        ("clusters = 4", "", "clusters is missing"),
        ("clusters = 4", "clusters = 4.0", "clusters must be an integer, not float"),
        ("clusters = 4", "clusters = 4\ncolour = 1", "colour is not a figure of a machine"),
        ("clusters = 4", "clusters = 2", "latency.third_cluster = 120: this machine has no such level"),
        (
            "processors_per_cluster = 2",
            "processors_per_cluster = -2",
            "processors_per_cluster = -2: must lie in 1 to 64",
        ),
        ("name = 'sound'", "name = 7", "name must be a string, not integer"),
        ("clock_mhz = 100", "clock_mhz = 0", "clock_mhz = 0: must lie in 1 to 100000"),
        ("line_bytes = 32", "line_bytes = 48", "line_bytes = 48: must be a power of two"),
        ("line_bytes = 32", "line_bytes = 512", "line_bytes = 512: must lie in 8 to 256"),
        ("line_bytes = 32", "line_bytes = 4", "line_bytes = 4: must lie in 8 to 256"),
        ("word_bytes = 8", "word_bytes = 6", "word_bytes = 6: must be a power of two"),
        ("bytes = 1024", "bytes = 1000", "first_level.bytes = 1000: must be a power of two"),
        ("bytes = 1024", "bytes = 16", "first_level.bytes = 16: must lie in 32 to 1073741824"),
        ("bytes = 1024", "bites = 1024", "first_level.bytes is missing"),
        ("bytes = 1024", "bytes = 1024\nsets = 16", "first_level.sets is not a figure of a machine"),
        ("ways = 2", "ways = 3", "first_level.ways = 3: 1024 bytes are not a whole number of sets of 3 lines"),
        ("ways = 2", "ways = 64", "first_level.ways = 64: 1024 bytes are not a whole number of sets of 64 lines"),
        ("ways = 2", "ways = 0", "first_level.ways = 0: must lie in 1 to 1073741824"),
        ("bytes = 4096", "bytes = 512", "second_level.bytes = 512: must lie in 1024 to 1073741824"),
        ("[second_level]\nbytes = 4096\nways = 4", "", "latency.second_level = 4: this machine has no such level"),
        ("second_level = 4", "", "latency.second_level is missing"),
        ("first_level = 1", "first_level = 0", "latency.first_level = 0: must lie in 1 to 1000000"),
        ("first_level = 1", "first_level = 5", "latency.second_level = 4: a nearer level takes 5 clocks"),
        ("neighbour = 20", "neighbour = 3", "latency.neighbour = 3: a nearer level takes 4 clocks"),
        ("local_memory = 30", "local_memory = 19", "latency.local_memory = 19: a nearer level takes 20 clocks"),
        ("remote_memory = 90", "remote_memory = 29", "latency.remote_memory = 29: a nearer level takes 30 clocks"),
        ("remote_cache = 80", "remote_cache = 29", "latency.remote_cache = 29: a nearer level takes 30 clocks"),
        ("third_cluster = 120", "third_cluster = 89", "latency.third_cluster = 89: a nearer level takes 90 clocks"),
        ("third_cluster = 120", "third_cluster = 120\nmoon = 1", "latency.moon is not a figure of a machine"),
        ("[latency]", "[late]", "latency is missing"),
        ("[first_level]", "[level]", "first_level is missing"),
    ] {
        assert!(SOUND.contains(line), "{line}");
        let error = Spec::parse("mine.toml", &SOUND.replacen(line, instead, 1)).unwrap_err();
        assert_eq!(error.to_string(), format!("mine.toml: {message}"), "{line} -> {instead}");
    }
}

/// Would catch caches whose slots cannot be numbered: 8 of 1 GB can, 12 cannot.
#[test]
fn caches_beyond_all_bounds_are_named() {
    let large = SOUND.replace("bytes = 4096", "bytes = 1073741824");
    assert!(Spec::parse("mine.toml", &large).is_ok());
    let error = Spec::parse("mine.toml", &large.replace("cluster = 2", "cluster = 3")).unwrap_err();
    let message = "mine.toml: second_level.bytes = 1073741824: 12 of these have more than 268435456 lines";
    assert_eq!(error.to_string(), message);
}

/// Would catch an error that does not lead to the place.
#[test]
fn files_that_are_no_spec_are_named() {
    let error = Spec::parse("mine.toml", "name = 'x'\nclusters = = 4\n").unwrap_err();
    assert!(matches!(&error, SpecError::Syntax { .. }), "{error}");
    assert!(error.to_string().starts_with("mine.toml: line 2: "), "{error}");
    let error = Spec::read(std::path::Path::new("no/such.toml")).unwrap_err();
    assert!(error.to_string().starts_with("no/such.toml: cannot be read: "), "{error}");
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/specs/dash.toml");
    assert_eq!(Spec::read(path.as_ref()).unwrap(), Spec::dash().unwrap());
}
