//! The body as it is beside the body at rest.

use ivd_core::Image;
use serde::{Deserialize, Serialize};

use crate::Error;

/// Which state of the body panes show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Shows {
    /// As it is now.
    #[default]
    Now,
    /// At rest: the scan as it was read, whole where it was cut open; planes and boxes take away what they do of the body as it is.
    Rest,
    /// At rest to the left of a line, as it is now to its right.
    Both,
}

impl Shows {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Now, Self::Rest, Self::Both];

    /// How it is called in a window.
    pub fn word(self) -> &'static str {
        match self {
            Self::Now => "deformed",
            Self::Rest => "at rest",
            Self::Both => "at rest | deformed",
        }
    }
}

/// What panes show of the body's two states.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Compared {
    /// Which of them.
    pub shows: Shows,
    /// Where the line that divides both lies, as a share of a pane's width.
    pub at: f64,
}

impl Default for Compared {
    fn default() -> Self {
        Self { shows: Shows::Now, at: middle() }
    }
}

impl Compared {
    /// Whether the body is shown at rest at a share of a pane.
    pub fn is_rest_at(self, at: [f64; 2]) -> bool {
        match self.shows {
            Shows::Now => false,
            Shows::Rest => true,
            Shows::Both => at[0] < self.at,
        }
    }
}

/// The share at which pictures are divided at first.
pub(crate) fn middle() -> f64 {
    0.5
}

/// A picture whose columns to the left of a share of its width are those of another of its size.
pub(crate) fn divided(left: &Image, right: &Image, at: f64) -> Result<Image, Error> {
    let width = right.width();
    // The columns whose middles lie to the left.
    let columns = ((at * width as f64 - 0.5).ceil().max(0.0) as usize).min(width);
    let mut rgba = right.rgba().to_vec();
    for (row, from) in rgba.chunks_exact_mut(4 * width).zip(left.rgba().chunks_exact(4 * width)) {
        row[..4 * columns].copy_from_slice(&from[..4 * columns]);
    }
    Ok(Image::new(width, right.height(), rgba)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_divided_by_their_middles() {
        let [left, right] = [1, 2].map(|grey| Image::new(4, 2, vec![grey; 32]).unwrap());
        for (at, columns) in [(0.0, 0), (0.125, 0), (0.126, 1), (0.5, 2), (0.874, 3), (0.876, 4), (1.0, 4)] {
            let both = divided(&left, &right, at).unwrap();
            let row: Vec<u8> = (0..16).map(|i| if i < 4 * columns { 1 } else { 2 }).collect();
            assert_eq!(both.rgba(), [row.clone(), row].concat(), "{at}");
        }
    }
}
