//! Form factors between patches, unoccluded: a pair of patches goes in, their exchange area `A_i F_ij = A_j F_ji`
//! comes out; visibility is another kernel's.
