//! Links between elements: storage, and the refinement that decides which pairs exchange light.
