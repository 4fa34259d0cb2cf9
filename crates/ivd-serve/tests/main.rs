//! A page, and who may use it.
mod page;
