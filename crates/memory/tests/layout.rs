//! The simulated address space: where allocations come to lie, and what is refused.

#![allow(clippy::unwrap_used, reason = "tests")]

use isolux_memory::{Home, Kind, LayoutError, PAGE_BYTES, Spec, System};

fn system() -> System {
    System::new(&Spec::dash().unwrap(), 8).unwrap()
}

/// Would catch a change of the documented layout: regions that share a page, gaps, or lost alignment.
#[test]
fn allocations_lie_where_the_layout_says() {
    let mut system = system();
    let links = system.region("links", Home::RoundRobin).unwrap();
    let tree = system.region("tree", Home::FirstTouch).unwrap();
    let mut allocate = |region, bytes, align| system.allocate(region, bytes, align).unwrap();
    assert_eq!(allocate(links, 24, 8), 0);
    assert_eq!(allocate(links, 1, 1), 24);
    assert_eq!(allocate(links, 24, 16), 32);
    assert_eq!(allocate(tree, 100, 64), 4096); // a page of its own
    assert_eq!(allocate(links, 4040, 8), 56); // fills the page to its last byte
    assert_eq!(allocate(links, 1, 1), 8192); // page 1 is the tree's
    assert_eq!(allocate(tree, 3 * 4096, 1), 12288); // too large for the rest of page 1
    assert_eq!(allocate(tree, 4096, 4096), 24576);
    assert_eq!((system.region_at(8191), system.region_at(8192)), (Some(tree), Some(links)));
    assert_eq!(system.region_at(7 * PAGE_BYTES), None);
    assert_eq!(system.regions().collect::<Vec<_>>(), [(links, "links"), (tree, "tree")]);
}

/// Would catch what cannot be placed and is placed nevertheless.
#[test]
fn what_cannot_be_placed_is_refused() {
    let mut system = system();
    let name = || "links".to_owned();
    let links = system.region("links", Home::RoundRobin).unwrap();
    assert_eq!(system.region("links", Home::FirstTouch), Err(LayoutError::Twice { name: name() }));
    let error = LayoutError::NoSuchCluster { name: "far".to_owned(), cluster: 2, clusters: 2 };
    assert_eq!(system.region("far", Home::Cluster(2)), Err(error));
    assert_eq!(system.allocate(links, 0, 8), Err(LayoutError::Empty { name: name() }));
    for align in [0, 3, 8192] {
        assert_eq!(system.allocate(links, 8, align), Err(LayoutError::Alignment { name: name(), align }));
    }
    // Lines have numbers of 32 bits, the last of which stands for none: of 16 bytes, the last page is not whole.
    let end = (1_u64 << 36) - 4096;
    for bytes in [end + 1, u64::MAX] {
        assert_eq!(system.allocate(links, bytes, 1), Err(LayoutError::Full { name: name(), bytes, end }));
    }
    let stranger = System::new(&Spec::dash().unwrap(), 8).unwrap().region("other", Home::RoundRobin).unwrap();
    assert_eq!(system.name(stranger), Some("links")); // regions are numbers: the caller keeps them apart
    assert_eq!(system.allocate(links, 8, 8), Ok(0));
    assert_eq!(system.access(0, 4095, Kind::Read).unwrap().clocks, 30);
    system.check().unwrap();
}
