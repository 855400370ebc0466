//! What both task organisations have in common: lists of links, the refinement of an element, gathering, the way down and up
//! the quadtrees, vertex values.

mod gather;
mod lists;
mod refine;
mod vertices;
