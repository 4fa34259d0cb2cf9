//! Phantoms: generated volumes whose labels are known.
