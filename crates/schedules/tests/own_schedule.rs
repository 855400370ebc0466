//! The example of `docs/how-to/own-schedule.md`: it computes the same on all machines; the page shows what it prints.

#[expect(dead_code, reason = "the example's own main is not called here")]
#[path = "../examples/own_schedule.rs"]
mod example;

/// Catches a page that shows another table than the example prints, and a result that a machine changes.
#[test]
fn the_page_shows_the_table() {
    let table = example::table().expect("runs");
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/how-to/own-schedule.md");
    let page = std::fs::read_to_string(page).expect("a page of the project");
    for line in table.lines() {
        assert!(page.lines().any(|shown| shown.trim() == line.trim()), "not on the page: {line}");
    }
}

/// Catches a schedule that depends on the order of effects of simulated machines.
#[test]
fn threads_compute_the_same() {
    let (_, same) = example::on_threads(3).expect("runs");
    assert!(same);
}
