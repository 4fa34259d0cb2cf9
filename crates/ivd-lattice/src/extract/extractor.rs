//! Surfaces cut one after another.

use std::cell::RefCell;

use ivd_core::{BRICK, BrickIndex, Exec, Grid, Lattice, LatticeSource, Mask, Volume, with_voxels};
use rayon::prelude::*;

use super::bounds::{Bounds, Ordered};
use super::params::{ExtractParams, Iso};
use super::plan::{self, Cut, Cutting, Sampled};
use super::samples::{self, Field, Masked, Samples};
use super::signs::{self, BrickState, Signs};
use super::surface::Surface;
use super::sweep::{self, Spare};
use crate::Error;

/// A lattice and how much of the volume it took.
#[derive(Debug, Clone, PartialEq)]
pub struct Extracted {
    /// The lattice.
    pub lattice: Lattice,
    /// Bricks of 8³ cells that hold voxels inside and outside, as far as their range of values tells; without a mask
    /// no other brick is read.
    pub bricks_active: u64,
    /// Bricks of the volume.
    pub bricks_total: u64,
}

/// Cuts surfaces one after another, as a slider of isovalues asks for: [`extract`](super::extract) with memory that is used
/// again.
///
/// A third of the time of a cut goes into pages that the operating system hands out and clears. An extractor keeps what it
/// worked in, and writes the next lattice into the memory of one that it was given back. The lattices are the same. It keeps
/// as much as the largest cut took.
///
/// ```
/// use ivd_core::{Exec, Grid, Volume, Voxels};
/// use ivd_lattice::extract::{Extractor, ExtractParams, Iso};
///
/// let grid = Grid::with_spacing([3, 3, 3], [1.0; 3])?;
/// let mut voxels = vec![0_u8; 27];
/// voxels[13] = 200;
/// let volume = Volume::new(grid, Voxels::from(voxels))?;
/// let mut extractor = Extractor::default();
/// for iso in [50.0, 100.0, 150.0] {
///     let cut = extractor.extract(&volume, None, &ExtractParams { iso: Iso::Value(iso) }, &Exec::default())?;
///     // Look at it, then:
///     extractor.reuse(cut.lattice);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Default)]
pub struct Extractor {
    signs: Signs,
    spare: Spare,
}

impl Extractor {
    /// As [`extract`](super::extract).
    ///
    /// # Errors
    /// As [`extract`](super::extract).
    pub fn extract(
        &mut self,
        volume: &Volume,
        mask: Option<&Mask>,
        params: &ExtractParams,
        exec: &Exec,
    ) -> Result<Extracted, Error> {
        params.check()?;
        if let Some(mask) = mask {
            volume.grid().require(mask.grid(), "volume", "mask")?;
        }
        exec.run(|| match (params.iso, mask) {
            (Iso::Mask, None) => Err(Error::MissingInput {
                asked: "the surface of a mask",
                needed: "a mask",
                remedy: "give a mask, or an isovalue",
            }),
            (Iso::Mask, Some(mask)) => self.cut_mask(mask, exec),
            // The voxels that either cut reads are touched by it, once it knows which they are.
            (iso, None) => {
                with_voxels!(volume.layers([]), voxels => self.cut_field(volume, voxels, &iso, exec))
            }
            (iso, Some(mask)) => {
                with_voxels!(volume.layers([]), voxels => self.cut_part(volume, voxels, mask, &iso, exec))
            }
        })
    }

    /// Takes the memory of a lattice that is no longer needed, for the next cut.
    pub fn reuse(&mut self, lattice: Lattice) {
        let (keys, places, triangles) = lattice.into_parts();
        let (keys, places, triangles) = (keys.into_vec(), places.into_vec(), triangles.into_vec());
        self.spare.surface = Surface { keys, places, triangles };
    }

    fn cut_field<T: Ordered>(
        &mut self,
        volume: &Volume,
        voxels: &[T],
        iso: &Iso,
        exec: &Exec,
    ) -> Result<Extracted, Error> {
        let field = Field { voxels, bounds: Bounds::new(volume, iso) };
        if !exec.skip {
            volume.voxels();
            return self.cut(&field, volume.grid(), source(iso), None, exec);
        }
        let bricks = signs::brick_states(volume.bricks(), &field.bounds);
        let [nx, ny, _] = volume.bricks().dims();
        let layers =
            bricks.chunks(nx * ny).enumerate().filter(|(_, layer)| layer.contains(&BrickState::Mixed));
        volume.layers(layers.map(|(z, _)| z * BRICK..(z + 1) * BRICK + 1));
        let (first, last) = (field.bounds.first.to_f64(), field.bounds.last.to_f64());
        let stored = plan::Signs::Stored { volume, first, last };
        self.cut(&field, volume.grid(), source(iso), Some((&bricks, stored)), exec)
    }

    fn cut_part<T: Ordered>(
        &mut self,
        volume: &Volume,
        voxels: &[T],
        mask: &Mask,
        iso: &Iso,
        exec: &Exec,
    ) -> Result<Extracted, Error> {
        let bounds = Bounds::new(volume, iso);
        let [nx, ny, _] = volume.grid().dims();
        let inside: Vec<bool> = mask.inside().par_chunks(nx * ny).map(|layer| layer.contains(&1)).collect();
        // An edge that crosses leads one layer out.
        let layers = (0..inside.len()).filter(|&z| inside[z]);
        volume.layers(layers.map(|z| z.saturating_sub(1)..z + 2));
        let part = Masked { mask: mask.inside(), field: Field { voxels, bounds }, contradicts: bounds.first };
        self.cut(&part, volume.grid(), source(iso), None, exec)
    }

    fn cut_mask(&mut self, mask: &Mask, exec: &Exec) -> Result<Extracted, Error> {
        if let Some(level) = mask.level() {
            return self.cut(
                &samples::levelled(mask.inside(), level),
                mask.grid(),
                LatticeSource::Mask,
                None,
                exec,
            );
        }
        self.cut(&samples::halfway(mask.inside()), mask.grid(), LatticeSource::Mask, None, exec)
    }

    /// The surface of `samples`; where bricks are given, only those of mixed bricks are looked at, and the signs are those of stored values.
    fn cut(
        &mut self,
        samples: &impl Samples,
        grid: &Grid,
        source: LatticeSource,
        stored: Option<(&[BrickState], plan::Signs<'_>)>,
        exec: &Exec,
    ) -> Result<Extracted, Error> {
        let dims = grid.dims();
        exec.check_memory("the signs of the voxels", Signs::bytes(dims))?;
        let flip = grid.linear_part().determinant() < 0.0;
        let (spare_signs, spare) = (std::mem::take(&mut self.signs), RefCell::new(&mut self.spare));
        let field = Sampled { samples, dims };
        let sweep = |signs: &Signs, exec: &Exec| {
            sweep::extract(samples, signs, dims, flip, &mut spare.borrow_mut(), exec)
        };
        let (surface, signs, bricks_active) = if let Some((bricks, stored)) = stored {
            let signs = RefCell::new(spare_signs);
            let on_processor = |exec: &Exec| {
                let read = signs.take().read(samples, dims, Some(bricks), exec)?;
                let surface = sweep(&read, exec);
                signs.replace(read);
                surface
            };
            let cut = Cut { dims, flip, signs: stored, field: &field, on_processor: &on_processor };
            let surface = exec.launch::<Cutting>(&cut)?;
            let active = bricks.iter().filter(|b| **b == BrickState::Mixed).count() as u64;
            (surface, signs.into_inner(), active)
        } else {
            let signs = spare_signs.read(samples, dims, None, exec)?;
            let (words, rows) = signs.as_words();
            let cut = Cut {
                dims,
                flip,
                signs: plan::Signs::Read { words, rows },
                field: &field,
                on_processor: &|exec| sweep(&signs, exec),
            };
            let surface = exec.launch::<Cutting>(&cut)?;
            let active = signs.mixed_bricks();
            (surface, signs, active)
        };
        self.signs = signs;
        let Surface { keys, places, triangles } = surface;
        let bricks_total = BrickIndex::dims_for(dims).map(|n| n as u64).iter().product();
        let lattice =
            Lattice::new(grid.clone(), keys.into(), places.into(), triangles.into())?.with_source(source);
        Ok(Extracted { lattice, bricks_active, bricks_total })
    }
}

fn source(iso: &Iso) -> LatticeSource {
    match *iso {
        Iso::Value(value) => LatticeSource::Iso(value),
        Iso::Interval { lower, upper } => LatticeSource::Interval { lower, upper },
        Iso::Mask => LatticeSource::Mask,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extract::extract;

    #[test]
    fn memory_used_again_changes_nothing() {
        let wave = |dims: [usize; 3], pitch: f64| {
            let grid = Grid::with_spacing(dims, [1.0, 0.5, 2.0]).unwrap();
            let value = |i| {
                let [x, y, z] = grid.index(i).0.map(|c| c as f64 * pitch);
                (x.sin() * y.cos() + y.sin() * z.cos() + z.sin() * x.cos()) as f32
            };
            let voxels: Vec<f32> = (0..grid.len()).map(value).collect();
            Volume::new(grid, voxels.into()).unwrap()
        };
        let volumes = [wave([40, 33, 21], 0.3), wave([9, 40, 50], 0.5), wave([70, 8, 3], 0.9)];
        let masks = volumes.each_ref().map(|v| {
            let inside: Vec<u8> = (0..v.grid().len()).map(|i| u8::from(i % 3 == 0)).collect();
            Mask::new(v.grid().clone(), inside.into()).unwrap()
        });
        for threads in [1, 8] {
            let exec = Exec::default().with_threads(threads);
            let mut extractor = Extractor::default();
            // From much to little and back, empty ones between, and a lattice that isn't given back.
            for (n, iso) in [0.0, 0.9, -0.3, 5.0, 0.1, -5.0, 0.0].into_iter().cycle().take(40).enumerate() {
                let (volume, mask) = (&volumes[n % 3], (n % 4 == 3).then_some(&masks[n % 3]));
                let params = ExtractParams { iso: if n % 8 == 7 { Iso::Mask } else { Iso::Value(iso) } };
                let expected = extract(volume, mask, &params, &exec).unwrap();
                let cut = extractor.extract(volume, mask, &params, &exec).unwrap();
                assert!(cut == expected, "cut {n} with {threads} threads");
                if n % 5 != 4 {
                    extractor.reuse(cut.lattice);
                }
            }
        }
    }

    #[test]
    fn a_smaller_lattice_takes_the_memory_of_a_larger_one() {
        let grid = Grid::with_spacing([24; 3], [1.0; 3]).unwrap();
        let distance = |i| grid.index(i).0.map(|c| c as f32 - 11.5).iter().map(|c| c * c).sum::<f32>().sqrt();
        let voxels: Vec<f32> = (0..grid.len()).map(|i| -distance(i)).collect();
        let volume = Volume::new(grid, voxels.into()).unwrap();
        let mut extractor = Extractor::default();
        let cut = |radius: f64, extractor: &mut Extractor| {
            let params = ExtractParams { iso: Iso::Value(-radius) };
            extractor.extract(&volume, None, &params, &Exec::default()).unwrap().lattice
        };
        let large = cut(9.0, &mut extractor);
        let at = [large.places().as_ptr().addr(), large.triangles().as_ptr().addr()];
        extractor.reuse(large);
        let small = cut(5.0, &mut extractor);
        assert_eq!([small.places().as_ptr().addr(), small.triangles().as_ptr().addr()], at);
    }
}
