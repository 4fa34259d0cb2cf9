//! Search trees against plain searches.

mod build;
mod inside;
mod lattices;
mod nearest;
