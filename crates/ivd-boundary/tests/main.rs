//! The one test program of this crate.

mod compete;
mod component;
mod contour;
mod edit;
mod starts;
mod surface;
