//! Cuts a lattice out of a volume: marching cubes.
