//! The ring solver: to be written.
