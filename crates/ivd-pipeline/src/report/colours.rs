//! Colours of classes: in slices, curves and swatches the same as in pictures.

use ivd_core::{TransferFunction, srgb};

/// Grey of a class that pictures don't show.
const CLEAR: [u8; 3] = [64; 3];

/// Colour of a class: its entry's, grey where that is clear; without a transfer function by its place in the order of the means.
pub(super) fn class_rgb(rank: usize, id: u16, transfer: Option<&TransferFunction>) -> [u8; 3] {
    match transfer.and_then(|transfer| transfer.entries().iter().find(|entry| entry.class == id)) {
        Some(entry) if entry.opacity > 0.0 => entry.rgb.map(srgb::byte),
        Some(_) => CLEAR,
        None => ivd_atf::class_colour(rank).map(srgb::byte),
    }
}

/// The same as CSS.
pub(super) fn class_colour(rank: usize, id: u16, transfer: Option<&TransferFunction>) -> String {
    ivd_report::html::css_colour(class_rgb(rank, id, transfer))
}
