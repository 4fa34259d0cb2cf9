//! What a window does, without one.
mod frames;
