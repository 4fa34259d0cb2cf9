//! Extraction and refinement through the public interface.

mod extract;
mod refine;
