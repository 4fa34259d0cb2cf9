//! The window, without a screen: hands, keys, names, and what is drawn.
mod window;
