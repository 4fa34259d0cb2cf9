//! Figures of a mesh: what can be counted about it.
