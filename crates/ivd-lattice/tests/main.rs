//! Extraction, refinement and mesh files through the public interface.

mod extract;
mod refine;
