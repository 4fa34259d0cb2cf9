//! A head with neck and shoulders: a person asleep, from signed distances alone.
//!
//! Everything is said in millimetres on an adult whose head is 230 mm high, in a frame whose origin lies between the eyes' height, the
//! middle of the head and the ears; the cube is [`SIDE`] of these wide whatever the number of voxels. Proportions are those of anthropometry
//! (Farkas 1994): eyes at half the head's height, breadth 0.66 and length 0.83 of it.

mod airway;
mod brain;
mod contrast;
mod ears;
mod face;
mod field;
mod jaw;
mod layers;
mod neck;
mod skull;
mod spine;

use super::params::Contrast;
use contrast::Tissue;
use field::Point;
use jaw::Teeth;
use layers::{Layer, Place};

pub(super) use contrast::TISSUES;

/// Edge of the cube, and the frame's origin in it (mm on an adult).
const SIDE: f64 = 320.0;
const ORIGIN: Point = [160.0, 178.0, 189.0];
/// Voxels over which a border is mixed: at the border as steep as a line over 1.5 voxels, and flat where it ends, so that gradients show no rings.
const BLUR: f64 = 2.3;
/// Voxels along the edge of a brick, for which layers that don't reach it are left out at once.
pub(super) const BRICK: usize = 8;

/// The bust on a cube of voxels.
pub(super) struct Bust {
    size: usize,
    contrast: Contrast,
    teeth: Teeth,
}

/// The coats that a brick needs: what is everywhere under them, and the layers whose surface may be met.
struct Coats {
    ground: Tissue,
    layers: Vec<Layer>,
    /// The skin is so far that nothing of it counts.
    deep: bool,
}

impl Bust {
    pub(super) fn new(size: usize, contrast: Contrast) -> Self {
        Self { size, contrast, teeth: Teeth::new() }
    }

    /// Edge of a voxel (mm on an adult).
    fn pitch(&self) -> f64 {
        SIDE / self.size as f64
    }

    /// Place of a voxel coordinate in the bust's frame.
    fn place(&self, voxel: Point) -> Point {
        std::array::from_fn(|a| (voxel[a] + 0.5) * self.pitch() - ORIGIN[a])
    }

    /// Distance of a voxel coordinate from the skin (voxels).
    pub(super) fn skin_distance(&self, voxel: Point) -> f64 {
        face::surface(self.place(voxel)) / self.pitch()
    }

    /// Noise-free values (0…1) and labels of the slices from `z` on.
    pub(super) fn slab(&self, z: usize, values: &mut [f64], ids: &mut [u16]) {
        let n = self.size;
        let top = z + values.len() / (n * n);
        for y in (0..n).step_by(BRICK) {
            for x in (0..n).step_by(BRICK) {
                let low = [x, y, z];
                let high = [(x + BRICK).min(n), (y + BRICK).min(n), top];
                let coats = self.coats(low, high);
                for k in low[2]..high[2] {
                    for j in low[1]..high[1] {
                        let row = ((k - z) * n + j) * n;
                        for i in low[0]..high[0] {
                            (values[row + i], ids[row + i]) = self.paint(&coats, [i, j, k]);
                        }
                    }
                }
            }
        }
    }

    /// The layers that may be met in a brick.
    fn coats(&self, low: [usize; 3], high: [usize; 3]) -> Coats {
        let middle = std::array::from_fn(|a| (low[a] + high[a] - 1) as f64 / 2.0);
        let half: Point = std::array::from_fn(|a| (high[a] - low[a] - 1) as f64 / 2.0);
        let radius = field::norm(half) * self.pitch();
        let margin = BLUR / 2.0 * self.pitch();
        let mut here = Place::new(self.place(middle), &self.teeth);
        let mut coats = Coats { ground: Tissue::Air, layers: Vec::new(), deep: false };
        let mut inside = false;
        for layer in Layer::ALL {
            let (least, greatest) = layer.bounds(&mut here, radius);
            if layer == Layer::Skin {
                if least > margin {
                    return coats;
                }
                coats.deep = greatest < -DEEP - margin;
                inside = greatest < 0.0;
            }
            // Where the airway opens, each voxel is asked on which side of the skin it lies.
            if greatest < -margin && (inside || layer != Layer::Airway) {
                coats.ground = layer.tissue();
                coats.layers.clear();
            } else if least <= margin {
                coats.layers.push(layer);
            }
        }
        coats
    }

    /// Value and label of a voxel.
    fn paint(&self, coats: &Coats, voxel: [usize; 3]) -> (f64, u16) {
        let mut value = coats.ground.value(self.contrast);
        let mut tissue = coats.ground;
        if coats.layers.is_empty() {
            return (value, tissue as u16);
        }
        let p = self.place(voxel.map(|v| v as f64));
        let mut here = if coats.deep { Place::deep(p, &self.teeth) } else { Place::new(p, &self.teeth) };
        for layer in &coats.layers {
            let d = layer.distance(&mut here) / self.pitch();
            let cover = field::smooth_step(0.5, -0.5, d / BLUR);
            value += (layer.tissue().value(self.contrast) - value) * cover;
            if d < 0.0 {
                // What is hollow before the nostril's skin is open air.
                let outside = *layer == Layer::Airway && here.skin() >= 0.0;
                tissue = if outside { Tissue::Air } else { layer.tissue() };
            }
        }
        (value, tissue as u16)
    }
}

/// So far under the skin no layer asks for it any more (mm on an adult).
const DEEP: f64 = 20.0;

#[cfg(test)]
mod tests;
