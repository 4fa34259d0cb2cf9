use ivd_core::srgb;

/// Colour of a class, by its place in the order of the means.
pub(super) fn class_rgb(rank: usize) -> [u8; 3] {
    ivd_atf::class_colour(rank).map(srgb::byte)
}

/// The same as CSS.
pub(super) fn class_colour(rank: usize) -> String {
    ivd_report::html::css_colour(class_rgb(rank))
}
