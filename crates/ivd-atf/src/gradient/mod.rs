//! Colour and opacity by value and gradient (Kindlmann & Durkin 1998; Kniss, Kindlmann & Hansen 2002), with arcs found from the data.
//!
//! Over the plane of value and gradient magnitude a material is a blob at its mean where little changes, and the boundary of two materials an arc
//! from the one's blob to the other's: the values between them, steepest half way. A boundary that passes through the values of a third
//! material isn't that material: it lies higher.
//!
//! - `border`: from every steep voxel up and down the slope, to the materials that it lies between (LH, Šereda et al. 2006), and how wide the
//!   boundaries are; what the inside of each class looks like.
//! - `plane`: how likely a blob or an arc is at a value and a gradient.
//! - `table`: what is seen there.

mod border;
mod plane;
mod table;

pub(crate) use table::{ByGradient, by_gradient};
