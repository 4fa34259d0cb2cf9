//! Refinement of a lattice: fewer of the same vertices.
